//! A screenshot, and what can be said of it.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;

/// Pixels of three or four bytes.
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    pub(crate) fn read(file: &[u8]) -> Self {
        let mut reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        let samples = info.color_type.samples();
        let pixels = bytes[..info.buffer_size()].chunks_exact(samples);
        let pixels = pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        Self { width: info.width, height: info.height, pixels }
    }

    /// As a PNG file of at most 256 colours: small enough for the book.
    pub(crate) fn small(&self) -> Vec<u8> {
        // The most frequent ones; of the others the nearest.
        let mut counts: BTreeMap<[u8; 3], u32> = BTreeMap::new();
        for pixel in &self.pixels {
            *counts.entry(pixel.map(|part| part & 0xf8)).or_default() += 1;
        }
        let mut palette: Vec<_> = counts.iter().map(|(colour, count)| (*count, *colour)).collect();
        palette.sort_unstable_by(|one, other| other.cmp(one));
        palette.truncate(256);
        let distance = |one: [u8; 3], other: [u8; 3]| {
            one.iter().zip(other).map(|(a, b)| i32::from(a.abs_diff(b)).pow(2)).sum::<i32>()
        };
        let nearest = |colour: &[u8; 3]| {
            let found =
                palette.iter().enumerate().min_by_key(|(_, (_, of))| distance(*of, *colour));
            found.map_or(0, |(at, _)| at as u8)
        };
        let known: BTreeMap<[u8; 3], u8> =
            counts.keys().map(|colour| (*colour, nearest(colour))).collect();
        // A colour stands for those near it: the brightest stays white.
        let full = |part: u8| part | (part >> 5);
        let bytes = palette.iter().flat_map(|(_, colour)| colour.map(full)).collect::<Vec<_>>();
        let indices: Vec<u8> =
            self.pixels.iter().map(|pixel| known[&pixel.map(|part| part & 0xf8)]).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(bytes);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&indices).unwrap();
        writer.finish().unwrap();
        file
    }

    pub(crate) fn colours(&self) -> usize {
        self.pixels.iter().collect::<BTreeSet<_>>().len()
    }

    /// From 0, black, to 255.
    pub(crate) fn brightness(&self) -> u64 {
        let sum: u64 = self.pixels.iter().flatten().map(|part| u64::from(*part)).sum();
        sum / (3 * self.pixels.len() as u64)
    }
}

//! Devices of all kinds, drivers of others, files, and devices that cannot be.

use crate::bench::{digest, module, options};
use crate::flash::Flash;
use embedded_storage::nor_flash::{self, NorFlash, NorFlashErrorKind, ReadNorFlash};
use embedded_storage::{ReadStorage, Storage};
use softplug_unit_slots::{
    Device, Eeprom, Error, FileDevice, Flash as Driver, Geometry, LARGEST_GRANULE, LEAST_ROOM,
    LONGEST_MODULE, Run, SetUpError, Slots,
};
use std::convert::Infallible;

/// Two downloads, a trial that fails, and the first one runs.
fn works<D: Device>(mut device: D) {
    let geometry = device.geometry();
    let mut slots = Slots::open(&mut device, options()).unwrap();
    let room = slots.room();
    let (first, second) = (module(1, room.min(9_001) as usize), module(2, 333));
    for (module, is_good) in [(&first, true), (&second, false)] {
        slots.begin(module.len() as u32, digest(module), None).unwrap();
        for (number, piece) in module.chunks(97).enumerate() {
            slots.write(97 * number as u32, piece).unwrap();
        }
        slots.finish().unwrap();
        slots.start_trial().unwrap();
        let Run::Trial { module: found, .. } = slots.boot().run else { panic!("{geometry:?}") };
        assert_eq!(found.digest, digest(module));
        if is_good { slots.confirm() } else { slots.fail() }.unwrap();
    }
    let mut slots = Slots::open(&mut device, options()).unwrap();
    let Run::Confirmed(found) = slots.boot().run else { panic!("{geometry:?}") };
    let mut bytes = vec![0; found.length as usize];
    slots.read(found.slot, 0, &mut bytes).unwrap();
    assert_eq!(bytes, *first.0);
}

#[test]
fn granules_and_blocks_of_all_sizes() {
    for granule in [1, 2, 4, 8, 16, 32, 64, 128, 256] {
        for erase in [64, 256, 528 * 64, 4_096, 65_536] {
            // Blocks that do not fill the half.
            for blocks in [6, 7, 31] {
                let geometry = Geometry { size: erase * blocks, erase, granule };
                let header = 192_u32.next_multiple_of(granule);
                let areas = 4 * (header + 32 * granule.max(16)).next_multiple_of(erase);
                if erase >= granule
                    && geometry.size >= areas + 2 * 1_024_u32.next_multiple_of(erase)
                {
                    works(Flash::new(geometry));
                }
            }
        }
    }
    works(Flash::new(Geometry { size: 32_768, erase: 1, granule: 1 }));
    works(Flash::new(Geometry { size: 32_768, erase: 32, granule: 1 }));
}

#[test]
fn a_header_in_large_granules_has_erased_bytes_behind_it() {
    let mut flash = Flash::new(Geometry { size: 65_536, erase: 256, granule: 256 });
    let mut slots = Slots::open(&mut flash, options()).unwrap();
    slots.begin(1, [1; 32], None).unwrap();
    assert_eq!(flash.bytes[..8], *b"SPLGSLOT");
    assert_eq!(flash.bytes[192..512], [0xFF; 320]);
}

fn refused(geometry: Geometry) -> SetUpError {
    struct Fake(Geometry);

    impl Device for Fake {
        type Error = Infallible;

        fn geometry(&self) -> Geometry {
            self.0
        }

        fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), Infallible> {
            panic!("it is refused unread")
        }

        fn erase(&mut self, _: u32, _: u32) -> Result<(), Infallible> {
            panic!("it is refused unread")
        }

        fn program(&mut self, _: u32, _: &[u8]) -> Result<(), Infallible> {
            panic!("it is refused unread")
        }
    }

    match Slots::open(Fake(geometry), options()) {
        Err(Error::SetUp(error)) => error,
        _ => panic!("{geometry:?}"),
    }
}

#[test]
fn devices_that_are_too_small() {
    for (erase, granule, needed) in [
        (1, 1, 4 * 704 + 2 * 1_024),
        (4_096, 4, 6 * 4_096),
        (512, 64, 4 * 2_560 + 2 * 1_024),
        (256, 256, 4 * 8_448 + 2 * 1_024),
    ] {
        works(Flash::new(Geometry { size: needed, erase, granule }));
        for size in [0, needed - erase] {
            let found = refused(Geometry { size, erase, granule });
            assert_eq!(found, SetUpError::TooSmall { size, needed: u64::from(needed) });
        }
    }
    let huge = Geometry { size: 1 << 31, erase: 1 << 31, granule: 1 };
    assert_eq!(refused(huge), SetUpError::TooSmall { size: 1 << 31, needed: 6 << 31 });
}

#[test]
fn sizes_that_do_not_fit_together() {
    let sound = Geometry { size: 65_536, erase: 4_096, granule: 4 };
    for geometry in [
        Geometry { granule: 0, ..sound },
        Geometry { granule: 3, ..sound },
        Geometry { granule: 2 * LARGEST_GRANULE, ..sound },
        Geometry { erase: 0, ..sound },
        Geometry { erase: 4_098, ..sound },
        Geometry { size: 65_535, ..sound },
        Geometry { size: u32::MAX, erase: u32::MAX, granule: 2 },
    ] {
        assert_eq!(refused(geometry), SetUpError::Geometry(geometry));
    }
}

#[test]
fn a_large_device_takes_no_longer_modules_than_the_abi() {
    assert_eq!(LONGEST_MODULE as usize, softplug_abi::limits::MODULE_BYTES);
    let flash = Flash::new(Geometry { size: 4 << 20, erase: 65_536, granule: 1 });
    assert_eq!(Slots::open(flash, options()).unwrap().room(), LONGEST_MODULE);
    let flash = Flash::new(Geometry { size: 6 * 4_096, erase: 4_096, granule: 1 });
    assert!(Slots::open(flash, options()).unwrap().room() >= LEAST_ROOM);
}

/// A flash driver as they are written for microcontrollers.
struct Chip(Vec<u8>);

impl nor_flash::ErrorType for Chip {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Chip {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        nor_flash::check_read(self, offset, bytes.len())?;
        bytes.copy_from_slice(&self.0[offset as usize..offset as usize + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Chip {
    const WRITE_SIZE: usize = 2;
    const ERASE_SIZE: usize = 2_048;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        nor_flash::check_erase(self, from, to)?;
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        nor_flash::check_write(self, offset, bytes.len())?;
        let part = &mut self.0[offset as usize..offset as usize + bytes.len()];
        assert!(part.iter().all(|byte| *byte == 0xFF));
        part.copy_from_slice(bytes);
        Ok(())
    }
}

#[test]
fn a_flash_driver_of_embedded_storage() {
    let driver = Driver(Chip(vec![0x5A; 65_536]));
    assert_eq!(driver.geometry(), Geometry { size: 65_536, erase: 2_048, granule: 4 });
    works(driver);
    let error = Driver(Chip(vec![0; 4_096])).program(1, &[0]).unwrap_err();
    assert_eq!(error.to_string(), "the flash driver says: Arguments are not properly aligned");
}

#[derive(Debug)]
struct Bytes(Vec<u8>);

impl ReadStorage for Bytes {
    type Error = Infallible;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0[offset as usize..offset as usize + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl Storage for Bytes {
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        self.0[offset as usize..offset as usize + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

#[test]
fn an_eeprom_driver_of_embedded_storage() {
    for page in [1, 32, 128, 256] {
        works(Eeprom { driver: Bytes(vec![0x00; 65_536]), page });
    }
    let driver = Bytes(vec![0xFF; 65_536]);
    let error = Slots::open(Eeprom { driver, page: 512 }, options()).unwrap_err();
    assert!(matches!(error, Error::SetUp(SetUpError::Geometry(_))), "{error}");
}

#[test]
fn a_file_keeps_what_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.bin");
    let geometry = Geometry { size: 65_536, erase: 4_096, granule: 4 };
    works(FileDevice::open(&path, geometry).unwrap());
    let mut slots = Slots::open(FileDevice::open(&path, geometry).unwrap(), options()).unwrap();
    assert!(matches!(slots.boot().run, Run::Confirmed(_)));
    assert!(FileDevice::open(&path, Geometry { granule: 3, ..geometry }).is_err());
    let mut device = slots.into_device();
    assert!(device.program(0, &[0; 4]).is_err(), "a programmed granule is not programmed again");
    assert!(device.erase(65_536, 4_096).is_err());
    assert!(device.program(65_536, &[0; 4]).is_err());
}

//! Takes a module into the slots of an MTD device, as a unit's firmware does, and says what it finds there.
//!
//! `cargo run --features std --example mtd DEVICE [MODULE]`: with MODULE it downloads it and starts its trial; without,
//! it boots, and confirms a module that is on trial. DEVICE may be a file too, of 256 KiB, which stands for NOR flash.
//! Modules need no signature here.

use sha2::{Digest, Sha256};
use softplug_unit_slots::{Begun, Device, FileDevice, Geometry, Options, Run, Slot, Slots, Trust};
use std::error::Error;
use std::path::Path;

/// What stands for a flash memory in a file.
const FILE: Geometry = Geometry { size: 256 << 10, erase: 4_096, granule: 1 };

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let device = arguments.next().ok_or("give the device")?;
    let module = arguments.next().map(std::fs::read).transpose()?;
    let device = Path::new(&device);
    #[cfg(target_os = "linux")]
    if device.starts_with("/dev") {
        return unit(softplug_unit_slots::MtdDevice::open(device)?, module.as_deref());
    }
    unit(FileDevice::open(device, FILE)?, module.as_deref())
}

fn unit<D: Device>(device: D, module: Option<&[u8]>) -> Result<(), Box<dyn Error>> {
    println!("{:?}", device.geometry());
    let options = Options { trust: Trust::unsigned_too(&[]), attempts: 3, most_erases: 10_000 };
    let mut slots = Slots::open(device, options)?;
    match module {
        Some(module) => download(&mut slots, module)?,
        None => boot(&mut slots)?,
    }
    for slot in Slot::BOTH {
        println!("slot {slot} {}, erased {} times", slots.look(slot), slots.erases(slot));
    }
    Ok(())
}

fn download<D: Device>(slots: &mut Slots<'_, D>, module: &[u8]) -> Result<(), Box<dyn Error>> {
    let length = u32::try_from(module.len())?;
    match slots.begin(length, Sha256::digest(module).into(), None)? {
        Begun::Fresh { slot } => {
            let mut sent = 0;
            for piece in module.chunks(500) {
                sent = slots.write(sent, piece)?;
            }
            slots.finish()?;
            slots.start_trial()?;
            println!("{sent} bytes are in slot {slot}, on trial from the next boot on");
        }
        begun => println!("{begun:?}"),
    }
    Ok(())
}

fn boot<D: Device>(slots: &mut Slots<'_, D>) -> Result<(), Box<dyn Error>> {
    match slots.boot().run {
        Run::Trial { module, attempt, of } => {
            println!("slot {} runs on trial, {attempt} of {of}", module.slot);
            slots.confirm()?;
        }
        Run::Confirmed(module) => println!("slot {} runs", module.slot),
        Run::Nothing => println!("nothing runs"),
    }
    Ok(())
}

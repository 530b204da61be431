//! The image that the emulated computer boots from: everything that it has, in memory.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::packages::Packages;
use super::{EmulatedError, QEMU, file_error};
use crate::Error;
use crate::run;

/// The first process.
const INIT: &str = include_str!("init");

/// Of the kernel's folder of modules; `init` loads them.
const MODULES: [&str; 14] = [
    "drivers/mtd/devices/phram.ko",
    "drivers/mtd/mtd.ko",
    "drivers/net/can/dev/can-dev.ko",
    "drivers/net/can/sja1000/kvaser_pci.ko",
    "drivers/net/can/sja1000/sja1000.ko",
    "drivers/net/can/vcan.ko",
    "drivers/usb/common/usb-common.ko",
    "drivers/usb/core/usbcore.ko",
    "drivers/usb/host/xhci-hcd.ko",
    "drivers/usb/host/xhci-pci.ko",
    "drivers/usb/serial/ftdi_sio.ko",
    "drivers/usb/serial/usbserial.ko",
    "net/can/can-isotp.ko",
    "net/can/can.ko",
];

/// What sets up CAN interfaces, which busybox's of the same name cannot.
const IP: &str = "ip";

/// The rules that make the lasting names of serial ports.
const RULES: [&str; 2] = ["50-udev-default.rules", "60-serial.rules"];

/// Folders that are there from the start.
const FOLDERS: [&str; 6] = ["dev", "proc", "run", "sys", "tmp", "work"];

/// What the booted machine is kept in, which goes with its image.
const STATE: &str = "machine.state";

/// Makes `kernel` and `initrd` in `folder`, if anything that goes into them has changed.
pub(super) fn make(
    folder: &Path,
    packages: &Packages,
    command: &Path,
    plugins: &Path,
) -> Result<(), Error> {
    let busybox = packages.file("bin/busybox")?;
    let mut files = vec![
        (busybox.clone(), "bin/busybox".to_owned()),
        (packages.file("bin/udevadm")?, "bin/udevadm".to_owned()),
        (command.to_owned(), "bin/softplug".to_owned()),
    ];
    let ip = run::find(IP).ok_or(EmulatedError::Gone { program: IP })?;
    files.push((ip.clone(), "sbin/ip".to_owned()));
    for program in [packages.file("bin/udevadm")?, command.to_owned(), ip] {
        for library in libraries(&program)? {
            let at = library.trim_start_matches('/').to_owned();
            files.push((PathBuf::from(library), at));
        }
    }
    let modules = format!("lib/modules/{}/kernel", packages.kernel_version());
    for module in MODULES {
        let name = module.rsplit('/').next().unwrap_or(module);
        let file = packages.file(&format!("{modules}/{module}"))?;
        files.push((file, format!("lib/modules/{name}")));
    }
    for rules in RULES {
        let at = format!("lib/udev/rules.d/{rules}");
        files.push((packages.file(&at)?, at));
    }
    for entry in fs::read_dir(plugins).map_err(|cause| file_error(plugins, cause))? {
        let plugin = entry.map_err(|cause| file_error(plugins, cause))?.path();
        let name = plugin.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.push((plugin, format!("plugins/{name}")));
    }
    files.sort();
    files.dedup();

    let contents = contents(packages, &files)?;
    let list = folder.join("contents");
    if folder.join("initrd").exists() && fs::read_to_string(&list).is_ok_and(|old| old == contents)
    {
        return Ok(());
    }
    // In this order: what is broken off is begun anew.
    for old in [STATE, "contents"] {
        match fs::remove_file(folder.join(old)) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
                return Err(file_error(&folder.join(old), cause).into());
            }
            _ => {}
        }
    }
    let kernel = packages.file(&format!("boot/vmlinuz-{}", packages.kernel_version()))?;
    copy(&kernel, &folder.join("kernel"))?;
    let tree = folder.join("tree");
    lay_out(&tree, &files)?;
    pack(&busybox, &tree, &folder.join("initrd"))?;
    fs::remove_dir_all(&tree).map_err(|cause| file_error(&tree, cause))?;
    fs::write(&list, contents).map_err(|cause| file_error(&list, cause))?;
    Ok(())
}

/// All that the machine depends on, to see whether it has changed.
fn contents(packages: &Packages, files: &[(PathBuf, String)]) -> Result<String, Error> {
    let qemu = run::output(Command::new(QEMU).arg("--version"))?;
    let mut text = format!("{}{}\n{INIT}", qemu, packages.kernel());
    for (file, at) in files {
        let about = fs::metadata(file).map_err(|cause| file_error(file, cause))?;
        let changed = about.modified().map_err(|cause| file_error(file, cause))?;
        writeln!(text, "{at} {} {changed:?}", about.len()).expect("a text takes all");
    }
    Ok(text)
}

/// The libraries that a program is linked with.
fn libraries(program: &Path) -> Result<BTreeSet<String>, Error> {
    let said = run::output(Command::new("ldd").arg(program))?;
    if let Some(library) = missing_library(&said) {
        let (program, library) = (program.display().to_string(), library.to_owned());
        return Err(EmulatedError::Library { program, library }.into());
    }
    Ok(found_libraries(&said))
}

/// `libx.so.1 => /lib/libx.so.1 (0x…)`, or the loader's bare path.
fn found_libraries(said: &str) -> BTreeSet<String> {
    said.split_whitespace().filter(|word| word.starts_with('/')).map(str::to_owned).collect()
}

fn missing_library(said: &str) -> Option<&str> {
    said.lines().find(|line| line.ends_with("not found"))?.split_whitespace().next()
}

fn lay_out(tree: &Path, files: &[(PathBuf, String)]) -> Result<(), Error> {
    if tree.exists() {
        fs::remove_dir_all(tree).map_err(|cause| file_error(tree, cause))?;
    }
    for name in FOLDERS {
        let path = tree.join(name);
        fs::create_dir_all(&path).map_err(|cause| file_error(&path, cause))?;
    }
    for (file, at) in files {
        copy(file, &tree.join(at))?;
    }
    // Debugging symbols are half of it.
    run::succeed(Command::new("strip").arg(tree.join("bin/softplug")))?;
    let init = tree.join("init");
    fs::write(&init, INIT).map_err(|cause| file_error(&init, cause))?;
    fs::set_permissions(&init, Permissions::from_mode(0o755))
        .map_err(|cause| file_error(&init, cause))?;
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), EmulatedError> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(|cause| file_error(folder, cause))?;
    }
    fs::copy(from, to).map_err(|cause| file_error(from, cause))?;
    Ok(())
}

/// In the form that the kernel unpacks at its start.
fn pack(busybox: &Path, tree: &Path, image: &Path) -> Result<(), Error> {
    let file = File::create(image).map_err(|cause| file_error(image, cause))?;
    // The list comes from `find`, which names a folder before what is in it.
    let mut command = Command::new(busybox);
    command.args(["sh", "-c", "\"$0\" find . | \"$0\" cpio -o -H newc"]).arg(busybox);
    let status = command.current_dir(tree).stdout(Stdio::from(file)).status();
    let status = status.map_err(|cause| file_error(busybox, cause))?;
    if status.success() { Ok(()) } else { Err(EmulatedError::Packing.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_are_read_from_what_ldd_says() {
        let said = "\tlinux-vdso.so.1 (0x00007f)\n\
            \tlibc.so.6 => /lib/x86_64-linux-gnu/libc.so.6 (0x00007f)\n\
            \t/lib64/ld-linux-x86-64.so.2 (0x00007f)\n";
        let found = ["/lib/x86_64-linux-gnu/libc.so.6", "/lib64/ld-linux-x86-64.so.2"];
        assert_eq!(found_libraries(said), found.map(str::to_owned).into());
        assert_eq!(missing_library(said), None);
        assert_eq!(missing_library("\tlibkmod.so.2 => not found\n"), Some("libkmod.so.2"));
    }
}

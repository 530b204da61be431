//! The machines that come with Softplug, a file each in `machines`.

/// Their texts, in the order of their names.
pub(crate) const KNOWN: &[&str] = &[
    include_str!("../../machines/bridgeport-boss.toml"),
    include_str!("../../machines/bridgeport-r2e3.toml"),
    include_str!("../../machines/brother-tc.toml"),
    include_str!("../../machines/fadal-88hs.toml"),
    include_str!("../../machines/fagor-8055.toml"),
    include_str!("../../machines/fanuc-0m.toml"),
    include_str!("../../machines/fanuc-16i.toml"),
    include_str!("../../machines/fanuc-3m.toml"),
    include_str!("../../machines/haas-vf.toml"),
    include_str!("../../machines/heidenhain-tnc.toml"),
    include_str!("../../machines/heidenhain-tnc-fe.toml"),
    include_str!("../../machines/heidenhain-tnc151.toml"),
    include_str!("../../machines/mazak-m32.toml"),
    include_str!("../../machines/milltronics-centurion.toml"),
    include_str!("../../machines/okuma-osp.toml"),
    include_str!("../../machines/siemens-840d.toml"),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use crate::catalogue::Catalogue;

    #[test]
    fn each_file_is_a_machine_of_its_name_and_none_is_left_out() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
        let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files: BTreeSet<_> =
            files.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
        let known = Catalogue::known();
        let names: BTreeSet<_> =
            known.machines().iter().map(|machine| machine.name.clone()).collect();
        assert_eq!(names, files);
        assert_eq!(names.len(), super::KNOWN.len());
    }

    #[test]
    fn each_has_a_source_and_what_it_lacks_is_said() {
        for machine in Catalogue::known().machines() {
            assert!(!machine.sources.is_empty(), "{}", machine.name);
            assert!(machine.line.is_some() || !machine.unsure.is_empty(), "{}", machine.name);
        }
    }
}

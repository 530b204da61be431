//! The arrows between the modules of a crate: those that stand side by side in one
//! module never need each other in a circle. What a module's own parts take from it
//! does not count: it is the room that they stand in.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use cargo_metadata::{MetadataCommand, TargetKind};
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, ItemMod, ItemUse, Lit, Meta, UseTree};

#[test]
fn modules_need_each_other_in_no_circle() {
    let metadata = MetadataCommand::new().no_deps().exec().unwrap();
    let mut circles = Vec::new();
    for package in &metadata.packages {
        for target in &package.targets {
            let is_built = |kind: &TargetKind| {
                matches!(kind, TargetKind::Lib | TargetKind::Bin | TargetKind::ProcMacro)
            };
            if target.kind.iter().any(is_built) {
                let tree = Tree::of(target.src_path.as_std_path());
                circles.extend(tree.circles(&package.name));
            }
        }
    }
    assert!(circles.is_empty(), "{} circles:\n{}", circles.len(), circles.join("\n"));
}

/// A file that no program names would be a test that nobody runs.
#[test]
fn each_file_of_tests_is_part_of_a_program() {
    let metadata = MetadataCommand::new().no_deps().exec().unwrap();
    let mut left_out = Vec::new();
    let mut count = 0;
    for package in &metadata.packages {
        let top = package.manifest_path.parent().unwrap().as_std_path();
        let trees = package.targets.iter().map(|target| Tree::of(target.src_path.as_std_path()));
        let named: BTreeSet<_> =
            trees.flat_map(|tree| tree.0).filter_map(|module| module.file).collect();
        let all = ["tests", "examples", "benches"].map(|folder| sources(&top.join(folder)));
        let all = all.into_iter().flatten().collect::<Vec<_>>();
        count += all.len();
        left_out.extend(all.into_iter().filter(|file| !named.contains(file)));
    }
    assert!(count > 200, "{count}");
    assert_eq!(left_out, Vec::<PathBuf>::new());
}

/// Every Rust source below a folder, if there is one.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    let found = paths.flat_map(|path| match path.extension() {
        Some(end) if end == "rs" => vec![path.canonicalize().unwrap()],
        _ => sources(&path),
    });
    found.collect()
}

/// The modules of a crate; the first is its root.
#[derive(Default)]
struct Tree(Vec<Module>);

#[derive(Default)]
struct Module {
    parent: Option<usize>,
    /// The file that it has for itself.
    file: Option<PathBuf>,
    children: BTreeMap<String, usize>,
    /// What names of other places stand for here.
    imported: BTreeMap<String, Vec<String>>,
    used: BTreeSet<Vec<String>>,
}

impl Tree {
    fn of(root: &Path) -> Self {
        let mut tree = Self(vec![Module::default()]);
        tree.read(0, root, root.parent().unwrap());
        tree
    }

    /// Reads a module's file, and those of its parts, which stand in `folder`.
    fn read(&mut self, module: usize, file: &Path, folder: &Path) {
        let text =
            fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed =
            syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.0[module].file = Some(file.canonicalize().unwrap());
        self.take(module, &parsed.items, file, folder);
    }

    fn take(&mut self, module: usize, items: &[Item], file: &Path, folder: &Path) {
        for item in items {
            match item {
                Item::Mod(part) if !is_for_tests(&part.attrs) => {
                    self.0.push(Module { parent: Some(module), ..Module::default() });
                    let child = self.0.len() - 1;
                    let name = part.ident.to_string();
                    let inside = folder.join(&name);
                    if let Some((_, items)) = &part.content {
                        self.take(child, items, file, &inside);
                    } else {
                        let (file, inside) = place(part, file, folder);
                        self.read(child, &file, &inside);
                    }
                    self.0[module].children.insert(name, child);
                }
                // Tests may need whatever they try.
                Item::Mod(_) => {}
                item => Paths(&mut self.0[module]).visit_item(item),
            }
        }
    }

    /// The module that holds what a path means in `from`.
    fn holder(&self, from: usize, path: &[String], left: usize) -> Option<usize> {
        let (first, mut rest) = path.split_first()?;
        let mut at = match first.as_str() {
            "crate" => 0,
            "self" => from,
            "super" => self.0[from].parent?,
            name if self.0[from].children.contains_key(name) => {
                rest = path;
                from
            }
            _ => return None,
        };
        while let Some((name, after)) = rest.split_first() {
            let module = &self.0[at];
            if name == "super" {
                at = module.parent?;
            } else if let Some(child) = module.children.get(name) {
                at = *child;
            } else if let Some(other) = module.imported.get(name).filter(|_| left > 0) {
                let path = [other, after].concat();
                return self.holder(at, &path, left - 1).or(Some(at));
            } else {
                break;
            }
            rest = after;
        }
        Some(at)
    }

    /// A module and those around it, the root first.
    fn line(&self, module: usize) -> Vec<usize> {
        let mut line: Vec<_> =
            std::iter::successors(Some(module), |module| self.0[*module].parent).collect();
        line.reverse();
        line
    }

    /// From module to module side by side, each with a path that makes the arrow.
    fn arrows(&self) -> BTreeMap<(usize, usize), String> {
        let mut arrows = BTreeMap::new();
        for (from, module) in self.0.iter().enumerate() {
            for path in &module.used {
                let Some(to) = self.holder(from, path, 8) else { continue };
                let (own, other) = (self.line(from), self.line(to));
                let parting = own.iter().zip(&other).find(|(own, other)| own != other);
                if let Some((own, other)) = parting {
                    let said = format!("{} has {}", self.name(from), path.join("::"));
                    arrows.entry((*own, *other)).or_insert(said);
                }
            }
        }
        arrows
    }

    /// Each circle with what makes it.
    fn circles(&self, package: &str) -> Vec<String> {
        let arrows = self.arrows();
        let mut reached: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
        for from in 0..self.0.len() {
            let mut open = vec![from];
            while let Some(at) = open.pop() {
                let next = arrows.range((at, 0)..=(at, usize::MAX)).map(|((_, to), _)| *to);
                open.extend(next.filter(|to| reached.entry(from).or_default().insert(*to)));
            }
        }
        let reaches =
            |from: usize, to: usize| reached.get(&from).is_some_and(|all| all.contains(&to));
        let mut told = BTreeSet::new();
        let mut circles = Vec::new();
        for from in 0..self.0.len() {
            let circle: Vec<_> =
                (0..self.0.len()).filter(|to| reaches(from, *to) && reaches(*to, from)).collect();
            if circle.is_empty() || !told.insert(circle.clone()) {
                continue;
            }
            let names: Vec<_> = circle.iter().map(|module| self.name(*module)).collect();
            let mut text = format!("{package}: {}", names.join(", "));
            for ((own, other), said) in &arrows {
                if circle.contains(own) && circle.contains(other) {
                    let (own, other) = (self.name(*own), self.name(*other));
                    text.extend(["\n    ", &own, " -> ", &other, ": ", said]);
                }
            }
            circles.push(text);
        }
        circles
    }

    fn name(&self, module: usize) -> String {
        let mut names = vec!["crate".to_owned()];
        for pair in self.line(module).windows(2) {
            let children = &self.0[pair[0]].children;
            let (name, _) = children.iter().find(|(_, child)| **child == pair[1]).unwrap();
            names.push(name.clone());
        }
        names.join("::")
    }
}

/// The file of a module that stands in one of its own, and the folder of its parts.
fn place(part: &ItemMod, file: &Path, folder: &Path) -> (PathBuf, PathBuf) {
    let name = part.ident.to_string();
    if let Some(path) = part.attrs.iter().find_map(path_attribute) {
        let file = file.parent().unwrap().join(path);
        let inside = file.parent().unwrap().to_owned();
        return (file, inside);
    }
    let inside = folder.join(&name);
    let (flat, deep) = (folder.join(format!("{name}.rs")), inside.join("mod.rs"));
    (if flat.exists() { flat } else { deep }, inside)
}

fn path_attribute(attribute: &Attribute) -> Option<String> {
    let Meta::NameValue(pair) = &attribute.meta else { return None };
    let Expr::Lit(literal) = &pair.value else { return None };
    match &literal.lit {
        Lit::Str(text) if pair.path.is_ident("path") => Some(text.value()),
        _ => None,
    }
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    let is_test = |attribute: &Attribute| match &attribute.meta {
        Meta::List(list) => list.path.is_ident("cfg") && list.tokens.to_string() == "test",
        _ => false,
    };
    attributes.iter().any(is_test)
}

/// Gathers the paths of a module.
struct Paths<'a>(&'a mut Module);

impl Paths<'_> {
    fn import(&mut self, tree: &UseTree, before: &[String]) {
        let (name, alias) = match tree {
            UseTree::Path(path) => {
                return self.import(&path.tree, &[before, &[path.ident.to_string()]].concat());
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import(tree, before));
            }
            UseTree::Glob(_) => {
                self.0.used.insert(before.to_vec());
                return;
            }
            UseTree::Name(name) => (name.ident.to_string(), name.ident.to_string()),
            UseTree::Rename(rename) => (rename.ident.to_string(), rename.rename.to_string()),
        };
        let mut path = before.to_vec();
        let is_itself = name == "self";
        if !is_itself {
            path.push(name);
        }
        self.0.used.insert(path.clone());
        let alias = if is_itself && alias == "self" { path.last().cloned() } else { Some(alias) };
        self.0.imported.extend(alias.map(|alias| (alias, path)));
    }
}

impl<'ast> Visit<'ast> for Paths<'_> {
    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.import(&item.tree, &[]);
    }

    fn visit_item(&mut self, item: &'ast Item) {
        let attributes = match item {
            Item::Fn(item) => &item.attrs[..],
            Item::Impl(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            _ => &[],
        };
        if !is_for_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            self.0.used.insert(path.segments.iter().map(|part| part.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }
}

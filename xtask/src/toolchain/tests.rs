//! The search for a toolchain on machines of every kind.

use std::collections::BTreeSet;
use std::ffi::OsStr;

use super::*;

/// A machine as a test describes it, which remembers what was done to it.
#[derive(Default)]
struct Fake {
    has_target: bool,
    rustup_works: bool,
    packages: BTreeSet<String>,
    root: bool,
    apt_works: bool,
    old: bool,
    installed: Vec<String>,
}

fn answer(yes: bool, why: &str) -> std::result::Result<(), String> {
    if yes { Ok(()) } else { Err(why.to_owned()) }
}

impl Machine for Fake {
    fn has_target(&mut self) -> bool {
        self.has_target
    }
    fn add_target(&mut self) -> std::result::Result<(), String> {
        answer(self.rustup_works, "no network")
    }
    fn has_packages(&mut self, packages: &[&str]) -> bool {
        packages
            .iter()
            .all(|package| self.packages.contains(*package))
    }
    fn may_install(&mut self) -> std::result::Result<(), String> {
        answer(self.root, "not root")
    }
    fn install(&mut self, packages: &[&str]) -> std::result::Result<(), String> {
        self.installed
            .extend(packages.iter().map(ToString::to_string));
        answer(self.apt_works, "E: Unable to locate package")
    }
    fn debian_is_new_enough(&mut self) -> std::result::Result<(), String> {
        answer(!self.old, "its rustc is 1.63.0, 1.95 is needed")
    }
}

fn search(machine: &mut Fake, need: Need) -> (Result<Way>, Vec<String>) {
    let mut said = Vec::new();
    let way = find(machine, need, &mut |line| said.push(line.to_owned()));
    (way, said)
}

fn with_packages(need: Need) -> Fake {
    let packages = need
        .debian_packages()
        .iter()
        .map(ToString::to_string)
        .collect();
    Fake {
        packages,
        ..Fake::default()
    }
}

#[test]
fn an_installed_target_is_used_as_it_is() {
    let mut machine = Fake {
        has_target: true,
        root: true,
        ..with_packages(Need::Lint)
    };
    let (way, said) = search(&mut machine, Need::Lint);
    assert_eq!(way, Ok(Way::Rustup));
    assert_eq!(
        said,
        ["thumbv7m-none-eabi: installed in the active toolchain"]
    );
    assert!(machine.installed.is_empty());
}

#[test]
fn rustup_goes_before_debian() {
    let mut machine = Fake {
        rustup_works: true,
        root: true,
        apt_works: true,
        ..Fake::default()
    };
    let (way, said) = search(&mut machine, Need::Build);
    assert_eq!(way, Ok(Way::Rustup));
    assert_eq!(
        said,
        ["thumbv7m-none-eabi: added to the active toolchain by rustup"]
    );
    assert!(machine.installed.is_empty());
}

#[test]
fn debian_packages_that_are_there_serve_without_root() {
    let mut machine = with_packages(Need::Build);
    let (way, said) = search(&mut machine, Need::Build);
    assert_eq!(way, Ok(Way::Debian));
    assert_eq!(said.len(), 1);
    assert!(
        said[0].contains("rustc-web") && said[0].contains("no network"),
        "{said:?}"
    );
    assert!(machine.installed.is_empty());
}

#[test]
fn root_on_debian_gets_the_packages_and_clippy_only_to_lint() {
    for need in [Need::Build, Need::Lint] {
        let mut machine = Fake {
            root: true,
            apt_works: true,
            ..Fake::default()
        };
        let (way, said) = search(&mut machine, need);
        assert_eq!(way, Ok(Way::Debian));
        assert_eq!(said.len(), 1, "{said:?}");
        assert_eq!(machine.installed, need.debian_packages());
        let clippy = machine.installed.contains(&"rust-web-clippy".to_owned());
        assert_eq!(clippy, need == Need::Lint);
    }
    let mut machine = Fake {
        root: true,
        apt_works: true,
        ..with_packages(Need::Build)
    };
    assert_eq!(search(&mut machine, Need::Lint).0, Ok(Way::Debian));
    assert!(
        !machine.installed.is_empty(),
        "packages to build are not enough to lint"
    );
}

#[test]
fn without_network_or_toolchain_a_sentence_says_what_to_do() {
    for machine in [
        Fake::default(),
        Fake {
            root: true,
            ..Fake::default()
        },
        Fake {
            old: true,
            ..with_packages(Need::Build)
        },
        Fake {
            root: true,
            apt_works: true,
            old: true,
            ..Fake::default()
        },
    ] {
        let mut machine = machine;
        let (way, _) = search(&mut machine, Need::Build);
        let text = way.unwrap_err().to_string();
        assert!(!text.contains('\n'), "{text}");
        for part in [
            "rustup target add thumbv7m-none-eabi",
            "apt-get install",
            "no network",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    let mut old = Fake {
        old: true,
        ..with_packages(Need::Build)
    };
    let text = search(&mut old, Need::Build).0.unwrap_err().to_string();
    assert!(text.contains("1.63.0"), "{text}");
}

#[test]
fn debian_cargo_is_kept_from_rustups_toolchain() {
    let command = Way::Debian.cargo("build");
    assert_eq!(command.get_program(), "/usr/bin/cargo");
    let arguments: Vec<_> = command.get_args().collect();
    assert_eq!(arguments, ["build", "-Zbuild-std=core", "--target", TARGET]);
    let environment: Vec<_> = command.get_envs().collect();
    for cleared in ["RUSTUP_TOOLCHAIN", "RUSTC", "CARGO", "LD_LIBRARY_PATH"] {
        assert!(
            environment.contains(&(OsStr::new(cleared), None)),
            "{cleared}"
        );
    }
    assert!(environment.contains(&(OsStr::new("RUSTC_BOOTSTRAP"), Some(OsStr::new("1")))));
    assert!(Way::Rustup.cargo("build").get_envs().next().is_none());
}

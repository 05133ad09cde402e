//! The keys of updates. A private key signs images: PKCS#8 in PEM, as openssl reads it, or 64 hexadecimal digits. The
//! loader has the public halves of two, 64 digits each.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, ensure};
use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use ed25519_dalek::pkcs8::{DecodePrivateKey as _, EncodePrivateKey as _, KeypairBytes};
use ed25519_dalek::{SigningKey, VerifyingKey};
use fs_err as fs;
use sha2::{Digest as _, Sha512};

use crate::error::usage;
use crate::workspace::Workspace;

/// The private key that everybody has.
const DEVELOPMENT: &str = "loader/keys/development.key";
/// The public halves of this key and of a second one, which everybody has, too.
const DEVELOPMENT_PUBLIC: &str = include_str!("../../loader/keys/development.pub");
/// The public keys of the loader in a release.
const PRODUCTION: &str = "loader/keys/production.pub";

/// The file of a new key, or of one whose public half is shown.
#[derive(clap::Args, Debug)]
pub struct New {
    /// A file that does not exist yet
    #[arg(value_name = "FILE", required_unless_present = "public")]
    file: Option<PathBuf>,

    /// Show the public half of the private key in this file, and make none
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    public: Option<PathBuf>,
}

/// The public keys that a loader is built with.
#[derive(clap::Args, Clone, Debug, Default)]
#[group(skip)]
pub struct Trusted {
    /// The two public keys that the loader trusts, a line for each; without them the development keys, which everybody
    /// has
    #[arg(long, value_name = "FILE", env = "MODIO_KEYS")]
    keys: Option<PathBuf>,
}

impl Trusted {
    /// Passes the keys to the builds.
    pub fn apply(&self, workspace: &mut Workspace) -> Result<()> {
        if let Some(file) = &self.keys {
            workspace.keys = Some(std::path::absolute(file)?);
        }
        Ok(())
    }
}

/// The keys of a release.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Release {
    /// Private key that signs the images, for a release of your own. CI builds with --unsigned and signs without
    /// the sources
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,

    /// The two public keys that the loader trusts, a line for each [default: loader/keys/production.pub]
    #[arg(long, value_name = "FILE", env = "MODIO_KEYS")]
    keys: Option<PathBuf>,

    /// The second key signs, to end the first one in every unit that confirms these images, for good
    #[arg(long)]
    end_first_key: bool,
}

/// Refuses images by the second key that are not meant to end the first one, and images that are and do not. `keys` are
/// those of the loader.
pub fn check_second(
    keys: &[VerifyingKey; 2],
    by: &VerifyingKey,
    end_first_key: bool,
) -> Result<()> {
    let [_, second] = keys;
    match (by == second, end_first_key) {
        (true, false) => Err(usage(
            "the second key signs only images that end the first one in every unit that confirms them, for good; \
             --end-first-key says that this is meant",
        )),
        (false, true) => Err(usage(
            "--end-first-key: the first key signs these images, which ends nothing",
        )),
        _ => Ok(()),
    }
}

/// `cargo xtask keygen`.
pub fn run(workspace: &Workspace, options: &New) -> Result<()> {
    match (&options.file, &options.public) {
        (Some(file), _) => generate(file),
        (None, file) => {
            let key = read(workspace, file.as_deref())?;
            say!("{}", digits(key.verifying_key().as_bytes()));
            Ok(())
        }
    }
}

/// Makes a private key in a new file, and shows its public half.
pub fn generate(path: &Path) -> Result<()> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).context("the system has no random numbers")?;
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    fs_err::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options.open(path);
    let mut file = file.map_err(|error| usage(error.to_string()))?;
    // Without the public half, which openssl 3.0 refuses there.
    let pair = KeypairBytes {
        secret_key: bytes,
        public_key: None,
    };
    let pem = pair.to_pkcs8_pem(LineEnding::LF);
    let pem = pem.map_err(|error| anyhow!("no PEM of a key: {error}"))?;
    file.write_all(pem.as_bytes())?;
    let public = SigningKey::from_bytes(&bytes).verifying_key();
    say!("{}", digits(public.as_bytes()));
    eprintln!(
        "xtask: {} has the private key: keep it secret, and keep a copy. The line above is its public half, a line of \
         {PRODUCTION}: the loader trusts the keys of two lines, the second of which stays in a safe",
        path.display()
    );
    Ok(())
}

/// Reads a private key, or the development key.
pub fn read(workspace: &Workspace, path: Option<&Path>) -> Result<SigningKey> {
    let development = workspace.root.join(DEVELOPMENT);
    let path = path.unwrap_or(&development);
    let text = fs::read_to_string(path).map_err(|error| usage(error.to_string()))?;
    private(&text).map_err(|why| usage(format!("{}: {why:#}", path.display())))
}

/// The same for a file that is signed again. The keys are those of `MODIO_KEYS`, of a release, or the development keys.
pub fn check_second_of(
    workspace: &Workspace,
    by: &VerifyingKey,
    end_first_key: bool,
) -> Result<()> {
    let production = workspace.root.join(PRODUCTION);
    let lines = match &workspace.keys {
        Some(file) => fs::read_to_string(file)?,
        None if production.exists() => fs::read_to_string(production)?,
        None => DEVELOPMENT_PUBLIC.to_owned(),
    };
    let key = |line| VerifyingKey::from_bytes(&bytes(line)?).ok();
    let keys: Option<Vec<_>> = lines.lines().map(key).collect();
    match keys.and_then(|keys| <[VerifyingKey; 2]>::try_from(keys).ok()) {
        Some(keys) => check_second(&keys, by, end_first_key),
        None => Ok(()),
    }
}

/// Refuses a private key, or the development key, that the loader does not trust: it would never start the image. Says
/// when a unit will take firmware of anybody.
pub fn check_loader(workspace: &Workspace, key: Option<&Path>) -> Result<()> {
    let own = digits(read(workspace, key)?.verifying_key().as_bytes());
    let file = workspace.keys.as_deref();
    let trusted = match file {
        Some(file) => fs::read_to_string(file).map_err(|error| usage(error.to_string()))?,
        None => DEVELOPMENT_PUBLIC.to_owned(),
    };
    if trusted.lines().all(|line| line != own) {
        let of = file.map_or("the development keys".into(), |file| {
            file.display().to_string()
        });
        return Err(usage(format!(
            "the loader would not start this image: it trusts {of}, and another key signs; --keys and --key belong together"
        )));
    }
    if DEVELOPMENT_PUBLIC
        .lines()
        .any(|line| trusted.contains(line))
    {
        eprintln!(
            "xtask: this unit takes firmware from anybody on its line, because everybody has the development keys; \
             docs/update.md says how to make your own"
        );
    }
    Ok(())
}

impl Release {
    /// Returns the public keys, and their file.
    pub fn public(&self, workspace: &Workspace) -> Result<([VerifyingKey; 2], PathBuf)> {
        let path = self.keys.clone();
        let path = path.unwrap_or_else(|| workspace.root.join(PRODUCTION));
        let text = fs::read_to_string(&path).map_err(|error| {
            usage(format!(
                "{error}: it has the two public keys, which `cargo xtask keygen` shows"
            ))
        })?;
        let keys = public(&text);
        let keys = keys.map_err(|why| usage(format!("{}: {why:#}", path.display())))?;
        Ok((keys, std::path::absolute(path)?))
    }

    /// As the function of this name.
    pub fn check_second(&self, keys: &[VerifyingKey; 2], by: &VerifyingKey) -> Result<()> {
        check_second(keys, by, self.end_first_key)
    }

    /// Returns the private key, which must be that of one of the public keys.
    pub fn private(&self, workspace: &Workspace, public: &[VerifyingKey; 2]) -> Result<SigningKey> {
        let path = self.key.as_ref().ok_or_else(|| {
            usage("no key to sign with: --key FILE, which `cargo xtask keygen FILE` makes, or --unsigned")
        })?;
        let key = read(workspace, Some(path))?;
        check(&key.verifying_key(), public).map_err(|why| usage(why.to_string()))?;
        self.check_second(public, &key.verifying_key())?;
        Ok(key)
    }
}

/// Returns the public keys of a release from two lines.
fn public(text: &str) -> Result<[VerifyingKey; 2]> {
    let key = |line| VerifyingKey::from_bytes(&bytes(line)?).ok();
    let keys: Option<Vec<_>> = text.lines().map(key).collect();
    let keys = keys.and_then(|keys| <[VerifyingKey; 2]>::try_from(keys).ok());
    let keys = keys.context("two lines of 64 hexadecimal digits are needed, the public keys")?;
    keys.iter().try_for_each(refuse_development)?;
    let [first, second] = keys.each_ref().map(|key| first_bytes(key.as_bytes()));
    ensure!(
        first != second,
        "both keys have the same number: the second one must be another key, which ends the first"
    );
    Ok(keys)
}

/// Refuses a key whose public half is the development key, or that the loader does not trust.
fn check(own: &VerifyingKey, public: &[VerifyingKey]) -> Result<()> {
    refuse_development(own)?;
    ensure!(
        public.contains(own),
        "the private key belongs to none of the public keys"
    );
    Ok(())
}

/// Refuses the development keys.
fn refuse_development(key: &VerifyingKey) -> Result<()> {
    let key = digits(key.as_bytes());
    ensure!(
        DEVELOPMENT_PUBLIC.lines().all(|line| line != key),
        "everybody has the development keys, so no release is signed with them"
    );
    Ok(())
}

/// Returns the first bytes of the SHA-512 of a public key, which name it in the header of an image.
pub fn first_bytes(public: &[u8; 32]) -> [u8; 4] {
    let hash: [u8; 64] = Sha512::digest(public).into();
    let [a, b, c, d, ..] = hash;
    [a, b, c, d]
}

pub fn private(text: &str) -> Result<SigningKey> {
    let text = text.trim();
    if text.starts_with("-----BEGIN") {
        return SigningKey::from_pkcs8_pem(text)
            .map_err(|_| anyhow!("not a private key: an Ed25519 key in PKCS#8 is needed"));
    }
    let bytes = bytes(text);
    let bytes = bytes.context("not a private key: 64 hexadecimal digits or PEM are needed")?;
    Ok(SigningKey::from_bytes(&bytes))
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the bytes of 64 hexadecimal digits.
fn bytes(digits: &str) -> Option<[u8; 32]> {
    let byte = |at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    let bytes: Option<Vec<u8>> = (0..digits.len()).step_by(2).map(byte).collect();
    bytes?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workspace() -> Workspace {
        Workspace::open().unwrap()
    }

    #[test]
    fn new_key_is_random_and_private_and_never_replaces_a_file() {
        let directory = tempfile::tempdir().unwrap();
        let new = ["a", "b"].map(|name| directory.path().join(name));
        new.iter().for_each(|new| generate(new).unwrap());
        let [a, b] = new
            .each_ref()
            .map(|new| read(&workspace(), Some(new)).unwrap());
        assert_ne!(a, b);
        let error = generate(&new[0]).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
        assert_eq!(read(&workspace(), Some(&new[0])).unwrap(), a);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = new[0].metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600);
        }
    }

    #[test]
    fn release_refuses_the_development_key_and_a_key_that_the_loader_does_not_trust() {
        let keys = [1, 2, 3].map(|byte| SigningKey::from_bytes(&[byte; 32]));
        let [own, safe, other] = keys.each_ref().map(SigningKey::verifying_key);
        let second = workspace().root.join("loader/keys/development-second.key");
        let both = [None, Some(&*second)];
        let [development, second] =
            both.map(|path| read(&workspace(), path).unwrap().verifying_key());
        let lines = |keys: &[&VerifyingKey]| {
            let lines: Vec<_> = keys.iter().map(|key| digits(key.as_bytes())).collect();
            public(&(lines.join("\n") + "\n"))
        };
        let trusted = lines(&[&own, &safe]).unwrap();
        assert!(check(&own, &trusted).is_ok() && check(&safe, &trusted).is_ok());
        let refused = |result: Result<()>, part: &str| {
            let text = result.unwrap_err().to_string();
            assert!(text.contains(part), "{text}");
        };
        refused(check(&other, &trusted), "belongs to none");
        assert!(check_second(&trusted, &own, false).is_ok());
        assert!(check_second(&trusted, &safe, true).is_ok());
        refused(check_second(&trusted, &safe, false), "--end-first-key says");
        refused(check_second(&trusted, &own, true), "ends nothing");
        refused(check(&development, &trusted), "everybody");
        refused(lines(&[&own, &development]).map(drop), "everybody");
        refused(check(&second, &trusted), "everybody");
        refused(lines(&[&own]).map(drop), "two lines");
        refused(lines(&[&own, &own]).map(drop), "same number");
        let missing = Release {
            key: None,
            keys: Some("/nowhere/keys".into()),
            end_first_key: false,
        };
        let error = missing.public(&workspace()).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
    }

    #[test]
    fn image_that_the_loader_would_not_start_is_refused_before_it_is_written() {
        let directory = tempfile::tempdir().unwrap();
        let [own, other, lines] = ["own", "other", "keys"].map(|name| directory.path().join(name));
        let both = [&own, &other].map(|file| {
            generate(file).unwrap();
            let key = read(&workspace(), Some(file)).unwrap();
            digits(key.verifying_key().as_bytes()) + "\n"
        });
        fs::write(&lines, both[0].repeat(2)).unwrap();
        let mut of_own = workspace();
        of_own.keys = Some(lines.clone());
        assert!(check_loader(&of_own, Some(&own)).is_ok());
        for (workspace, key) in [
            (&of_own, Some(&*other)),
            (&of_own, None),
            (&workspace(), Some(&own)),
        ] {
            let error = check_loader(workspace, key).unwrap_err();
            assert!(error.is::<crate::error::Usage>(), "{error}");
        }
        assert!(check_loader(&workspace(), None).is_ok());
    }

    #[test]
    fn development_key_belongs_to_the_first_public_key_of_the_loader() {
        let development = read(&workspace(), None).unwrap();
        assert_eq!(
            DEVELOPMENT_PUBLIC.lines().next(),
            Some(&digits(development.verifying_key().as_bytes())[..])
        );
        for wrong in ["", "12", "zz", &"é".repeat(32), &"00".repeat(33)] {
            assert!(private(wrong).is_err(), "{wrong}");
        }
    }
}

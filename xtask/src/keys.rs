//! The keys of updates: 64 hexadecimal digits. A private key signs images; the loader has the public halves of two.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
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

/// The file of a new key.
#[derive(clap::Args, Debug)]
pub struct New {
    /// A file that does not exist yet
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// The keys of a release.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Release {
    /// Private key that signs the images [default: the content of the variable MODIO_SIGNING_KEY]
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,

    /// The two public keys that the loader trusts, a line for each [default: loader/keys/production.pub]
    #[arg(long, value_name = "FILE", env = "MODIO_KEYS")]
    keys: Option<PathBuf>,
}

/// `cargo xtask keygen`.
pub fn generate(new: &New) -> Result<()> {
    let path = &new.file;
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).context("the system has no random numbers")?;
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    fs_err::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options.open(path);
    let mut file = file.map_err(|error| usage(error.to_string()))?;
    writeln!(file, "{}", digits(&bytes))?;
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

    /// Returns the private key, which must be that of one of the public keys.
    pub fn private(&self, workspace: &Workspace, public: &[VerifyingKey]) -> Result<SigningKey> {
        let variable = std::env::var("MODIO_SIGNING_KEY");
        let key = match (&self.key, variable) {
            (Some(path), _) => read(workspace, Some(path))?,
            (None, Ok(text)) if !text.is_empty() => private(&text)
                .map_err(|why| usage(format!("the variable MODIO_SIGNING_KEY: {why:#}")))?,
            _ => {
                return Err(usage(
                    "no key to sign with: --key FILE, or the variable MODIO_SIGNING_KEY; `cargo xtask keygen FILE` \
                     makes one",
                ));
            }
        };
        check(&key.verifying_key(), public).map_err(|why| usage(why.to_string()))?;
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

fn private(text: &str) -> Result<SigningKey> {
    let bytes = bytes(text.trim());
    let bytes = bytes.context("not a private key: 64 hexadecimal digits are needed")?;
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
        let new = ["a", "b"].map(|name| New {
            file: directory.path().join(name),
        });
        new.iter().for_each(|new| generate(new).unwrap());
        let [a, b] = new
            .each_ref()
            .map(|new| read(&workspace(), Some(&new.file)).unwrap());
        assert_ne!(a, b);
        let error = generate(&new[0]).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
        assert_eq!(read(&workspace(), Some(&new[0].file)).unwrap(), a);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = new[0].file.metadata().unwrap().permissions().mode();
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
        refused(check(&development, &trusted), "everybody");
        refused(lines(&[&own, &development]).map(drop), "everybody");
        refused(check(&second, &trusted), "everybody");
        refused(lines(&[&own]).map(drop), "two lines");
        let missing = Release {
            key: None,
            keys: Some("/nowhere/keys".into()),
        };
        let error = missing.public(&workspace()).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
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

//! The keys of updates. A private key signs images: PKCS#8 in PEM, as openssl reads it, or 64 hexadecimal digits. The
//! loader has the public halves of two, 64 digits each.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow};
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
pub const PRODUCTION: &str = "loader/keys/production.pub";

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
    #[cfg(test)]
    pub fn of(file: &Path) -> Self {
        Self {
            keys: Some(file.to_owned()),
        }
    }

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

/// The two public keys that a loader trusts, the first and the second.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    keys: [VerifyingKey; 2],
    /// Where they come from, for people.
    of: String,
}

impl Pair {
    /// Returns those that the loader is built with: of `--keys` or `MODIO_KEYS`, or the development keys.
    pub fn of(workspace: &Workspace) -> Result<Self> {
        match &workspace.keys {
            Some(file) => Self::read(file),
            None => Self::parse(DEVELOPMENT_PUBLIC, "the development keys".to_owned()),
        }
    }

    fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|error| {
            usage(format!(
                "{error}: it has the two public keys, which `cargo xtask keygen` shows"
            ))
        })?;
        Self::parse(&text, path.display().to_string())
    }

    fn parse(text: &str, of: String) -> Result<Self> {
        let wrong = |what| usage(format!("{of}: {what}"));
        let key = |line| VerifyingKey::from_bytes(&bytes(line)?).ok();
        let keys: Option<Vec<_>> = text.lines().map(key).collect();
        let keys = keys.and_then(|keys| <[VerifyingKey; 2]>::try_from(keys).ok());
        let keys = keys.ok_or_else(|| {
            wrong("two lines of 64 hexadecimal digits are needed, the public keys")
        })?;
        let [first, second] = keys.each_ref().map(|key| first_bytes(key.as_bytes()));
        if first == second {
            return Err(wrong(
                "both keys have the same number: the second one must be another key, which ends the first",
            ));
        }
        Ok(Self { keys, of })
    }

    /// Returns the keys, the first one first.
    pub const fn keys(&self) -> &[VerifyingKey; 2] {
        &self.keys
    }

    /// Refuses images by a key that the loader does not trust, images by the second key that are not meant to end the
    /// first one, and images by the first key that are.
    pub fn check(&self, by: &VerifyingKey, end_first_key: bool) -> Result<()> {
        let [first, second] = &self.keys;
        let why = match end_first_key {
            _ if ![first, second].contains(&by) => format!(
                "the loader would not start this image: it trusts {}, and another key signs; --keys and --key belong together",
                self.of
            ),
            false if by == second => "the second key signs only images that end the first one in every unit that confirms \
                 them, for good; --end-first-key says that this is meant"
                .to_owned(),
            true if by == first => "--end-first-key: the first key signs these images, which ends nothing".to_owned(),
            _ => return Ok(()),
        };
        Err(usage(why))
    }

    /// Returns whether one of them is a development key.
    pub fn has_development(&self) -> bool {
        self.keys.iter().any(is_development)
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

impl Release {
    /// Returns the public keys, and their file.
    pub fn public(&self, workspace: &Workspace) -> Result<(Pair, PathBuf)> {
        let path = self.keys.clone();
        let path = path.unwrap_or_else(|| workspace.root.join(PRODUCTION));
        let pair = Pair::read(&path)?;
        if pair.has_development() {
            return Err(usage(format!(
                "{}: everybody has the development keys, so no release is signed with them",
                path.display()
            )));
        }
        Ok((pair, std::path::absolute(path)?))
    }

    /// Refuses images that this key has signed, as [`Pair::check`] does.
    pub fn check(&self, pair: &Pair, by: &VerifyingKey) -> Result<()> {
        pair.check(by, self.end_first_key)
    }

    /// Returns the private key, which must be that of one of the public keys.
    pub fn private(&self, workspace: &Workspace, pair: &Pair) -> Result<SigningKey> {
        let path = self.key.as_ref().ok_or_else(|| {
            usage("no key to sign with: --key FILE, which `cargo xtask keygen FILE` makes, or --unsigned")
        })?;
        let key = read(workspace, Some(path))?;
        self.check(pair, &key.verifying_key())?;
        Ok(key)
    }
}

/// Returns whether everybody has the private half of this key.
pub fn is_development(key: &VerifyingKey) -> bool {
    let key = digits(key.as_bytes());
    DEVELOPMENT_PUBLIC.lines().any(|line| line == key)
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

    fn public(keys: &[&SigningKey]) -> String {
        let line = |key: &&SigningKey| digits(key.verifying_key().as_bytes()) + "\n";
        keys.iter().map(line).collect()
    }

    fn refused<T: std::fmt::Debug>(result: Result<T>, part: &str) {
        let error = result.unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    }

    #[test]
    fn loader_trusts_two_keys_and_the_second_signs_only_when_asked_to_end_the_first() {
        let keys = [1, 2, 3].map(|byte| SigningKey::from_bytes(&[byte; 32]));
        let [first, second, other] = &keys;
        let of = |keys: &[&SigningKey]| Pair::parse(&public(keys), "keys.pub".to_owned());
        let pair = of(&[first, second]).unwrap();
        let capital = public(&[first, second]).to_uppercase();
        assert_eq!(Pair::parse(&capital, "keys.pub".to_owned()).unwrap(), pair);
        for (keys, part) in [
            (&[][..], "two lines"),
            (&[first], "two lines"),
            (&[first, second, other], "two lines"),
            (&[first, first], "same number"),
        ] {
            refused(of(keys), part);
        }
        let check = |by: &SigningKey, end| pair.check(&by.verifying_key(), end);
        assert!(check(first, false).is_ok() && check(second, true).is_ok());
        refused(check(second, false), "--end-first-key says");
        refused(check(first, true), "ends nothing");
        refused(check(other, false), "trusts keys.pub");
        refused(check(other, true), "trusts keys.pub");
        assert!(!pair.has_development());
    }

    #[test]
    fn release_refuses_the_development_keys_and_a_missing_file() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("keys.pub");
        let release = Release {
            key: None,
            keys: Some(file.clone()),
            end_first_key: false,
        };
        refused(release.public(&workspace()), "keys.pub");
        let own = SigningKey::from_bytes(&[1; 32]);
        let second = workspace().root.join("loader/keys/development-second.key");
        for development in [None, Some(&*second)] {
            let development = read(&workspace(), development).unwrap();
            // Capital digits are the same key.
            let lines = public(&[&own, &development]).to_uppercase();
            fs::write(&file, lines).unwrap();
            refused(release.public(&workspace()), "everybody");
        }
        let safe = SigningKey::from_bytes(&[2; 32]);
        fs::write(&file, public(&[&own, &safe])).unwrap();
        let (pair, _) = release.public(&workspace()).unwrap();
        refused(release.private(&workspace(), &pair), "no key to sign with");
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

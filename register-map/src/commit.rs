//! The commit that a program is built from: for the registers COMMIT and BUILD, and for `--version` of the tools.
//!
//! Both macros ask git while the crate that calls them is compiled. Call them in a program rather than in its library,
//! so that a commit compiles little again.

/// Expands to the first eight digits of the commit, followed by `-dirty` when files that git tracks differ from it:
/// `1a2b3c4d`, `1a2b3c4d-dirty`. Outside a git repository, and without git, it is `unknown`.
#[macro_export]
macro_rules! commit {
    () => {
        $crate::git_version!(
            args = ["--always", "--exclude=*", "--abbrev=8", "--dirty"],
            fallback = "unknown"
        )
    };
}

/// Expands to the version of the calling package and its [`commit!`](crate::commit!): `0.2.0 (1a2b3c4d)`.
#[macro_export]
macro_rules! version {
    () => {
        $crate::git_version!(
            prefix = concat!(env!("CARGO_PKG_VERSION"), " ("),
            suffix = ")",
            args = ["--always", "--exclude=*", "--abbrev=8", "--dirty"],
            fallback = concat!(env!("CARGO_PKG_VERSION"), " (unknown)")
        )
    };
}

/// Returns the first 32 bits of a commit, as [`commit!`](crate::commit!) writes it; 0 when it is not known.
///
/// # Panics
///
/// When the text does not begin with eight hexadecimal digits, though it has eight characters or more.
#[must_use]
pub const fn first_32_bits(commit: &str) -> u32 {
    let Some((digits, _)) = commit.split_at_checked(8) else {
        return 0;
    };
    match u32::from_str_radix(digits, 16) {
        Ok(number) => number,
        Err(_) => panic!("eight hexadecimal digits"),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn version_is_followed_by_the_commit() {
        let commit = commit!();
        let digits = commit.trim_end_matches("-dirty");
        let is_hex = digits.len() >= 8 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
        assert!(is_hex || commit == "unknown", "{commit}");
        let [before, after] = [concat!(env!("CARGO_PKG_VERSION"), " ("), ")"];
        let rest = version!().strip_prefix(before).unwrap();
        assert_eq!(rest.strip_suffix(after), Some(commit));
    }
}

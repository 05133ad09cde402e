//! The simulator as a container image: an archive in the OCI image layout, for `podman load` and `docker load`.
//!
//! ```text
//! oci-layout                   the version of the layout
//! index.json ──> blobs/sha256/manifest ──> blobs/sha256/config   how the container starts
//!                                     └──> blobs/sha256/layer    its files: a tar with the program
//! manifest.json                the same for docker before version 25
//! ```
//!
//! All times are 0 and all owners root, so that the same program gives the same archive.

use anyhow::{Result, bail};
use register_map::Board;
use serde_json::{Value, json};
use tar::{Builder, EntryType, Header};

use super::sha256;

/// The image's name and tag.
const NAME: &str = concat!("modio-sim:", env!("CARGO_PKG_VERSION"));
/// The program in the image.
const PROGRAM: &str = "modio-sim";
/// The ports on which the simulator listens, on all addresses: a container's loopback is not the host's.
const HTTP: u16 = 8502;
const TCP: u16 = 5020;
/// A user without a name and without rights. A volume for `--flash` must be writable by this user.
const USER: &str = "65532:65532";

const MANIFEST: &str = "application/vnd.oci.image.manifest.v1+json";
const CONFIG: &str = "application/vnd.oci.image.config.v1+json";
const LAYER: &str = "application/vnd.oci.image.layer.v1.tar";

/// Returns the archive with this program, for a processor with its name in Rust.
pub fn archive(program: &[u8], processor: &str) -> Result<Vec<u8>> {
    let architecture = match processor {
        "x86_64" => "amd64",
        "aarch64" => "arm64",
        "riscv64gc" => "riscv64",
        other => bail!("no container image for {other}"),
    };
    let layer = packed(&[(PROGRAM, 0o755, program)])?;
    let config = config(architecture, &sha256(&layer)).to_string();
    let config = config.as_bytes();
    let manifest = json!({
        "schemaVersion": 2,
        "mediaType": MANIFEST,
        "config": descriptor(CONFIG, config),
        "layers": [descriptor(LAYER, &layer)],
    });
    let manifest = manifest.to_string();
    let mut entry = descriptor(MANIFEST, manifest.as_bytes());
    entry["annotations"] = json!({
        "org.opencontainers.image.ref.name": NAME,
        // The image's name in podman and containerd after loading.
        "io.containerd.image.name": format!("docker.io/library/{NAME}"),
    });
    entry["platform"] = json!({ "architecture": architecture, "os": "linux" });
    let index = json!({
        "schemaVersion": 2,
        "mediaType": "application/vnd.oci.image.index.v1+json",
        "manifests": [entry],
    });
    let blob = |content: &[u8]| format!("blobs/sha256/{}", sha256(content));
    let old = json!([{ "Config": blob(config), "RepoTags": [NAME], "Layers": [blob(&layer)] }]);
    packed(&[
        ("oci-layout", 0o644, br#"{"imageLayoutVersion":"1.0.0"}"#),
        ("index.json", 0o644, index.to_string().as_bytes()),
        ("manifest.json", 0o644, old.to_string().as_bytes()),
        (&blob(manifest.as_bytes()), 0o644, manifest.as_bytes()),
        (&blob(config), 0o644, config),
        (&blob(&layer), 0o644, &layer),
    ])
}

/// Returns the configuration of the image: how the container starts, and its files.
fn config(architecture: &str, layer: &str) -> Value {
    let boards = Board::ALL.map(|board| board.name).join(" and ");
    json!({
        "architecture": architecture,
        "os": "linux",
        "config": {
            "User": USER,
            "ExposedPorts": { format!("{HTTP}/tcp"): {}, format!("{TCP}/tcp"): {} },
            "Entrypoint": [
                format!("/{PROGRAM}"), "--http", format!("0.0.0.0:{HTTP}"), "--tcp", format!("0.0.0.0:{TCP}"),
            ],
            "Labels": {
                "org.opencontainers.image.title": PROGRAM,
                "org.opencontainers.image.description": format!("Virtual boards {boards}"),
                "org.opencontainers.image.version": env!("CARGO_PKG_VERSION"),
                "org.opencontainers.image.licenses": "MIT OR Apache-2.0",
            },
        },
        "rootfs": { "type": "layers", "diff_ids": [format!("sha256:{layer}")] },
    })
}

fn descriptor(kind: &str, content: &[u8]) -> Value {
    json!({
        "mediaType": kind,
        "digest": format!("sha256:{}", sha256(content)),
        "size": content.len(),
    })
}

/// Returns a tar of these files: name, permissions, content.
fn packed(files: &[(&str, u32, &[u8])]) -> Result<Vec<u8>> {
    let mut tar = Builder::new(Vec::new());
    for (name, mode, content) in files {
        let mut header = Header::new_ustar();
        header.set_entry_type(EntryType::Regular);
        header.set_mode(*mode);
        header.set_size(content.len() as u64);
        header.set_uid(0);
        header.set_gid(0);
        header.set_mtime(0);
        tar.append_data(&mut header, name, *content)?;
    }
    Ok(tar.into_inner()?)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::Read as _;

    use super::*;

    fn unpacked(archive: &[u8]) -> BTreeMap<String, Vec<u8>> {
        let mut archive = tar::Archive::new(archive);
        let entries = archive.entries().unwrap().map(|file| {
            let mut file = file.unwrap();
            assert_eq!(
                (file.header().mtime().unwrap(), file.header().uid().unwrap()),
                (0, 0)
            );
            let name = file.path().unwrap().to_string_lossy().into_owned();
            let mut content = Vec::new();
            file.read_to_end(&mut content).unwrap();
            (name, content)
        });
        entries.collect()
    }

    #[test]
    fn index_leads_to_the_program() {
        let files = unpacked(&archive(b"program", "x86_64").unwrap());
        let json = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap();
        // Returns the blob that a descriptor names, after a check of its size and sum.
        let blob = |descriptor: &Value| {
            let sum = descriptor["digest"]
                .as_str()
                .unwrap()
                .strip_prefix("sha256:");
            let content = &files[&format!("blobs/sha256/{}", sum.unwrap())];
            assert_eq!(Some(sha256(content).as_str()), sum);
            assert_eq!(descriptor["size"], content.len());
            content
        };
        let entry = &json(&files["index.json"])["manifests"][0];
        assert_eq!(entry["platform"]["architecture"], "amd64");
        let manifest = json(blob(entry));
        let config = json(blob(&manifest["config"]));
        let layer = &manifest["layers"][0];
        assert_eq!(config["rootfs"]["diff_ids"][0], layer["digest"]);
        assert_eq!(unpacked(blob(layer))["modio-sim"], b"program");
        let old = json(&files["manifest.json"]);
        assert!(files.contains_key(old[0]["Config"].as_str().unwrap()));
        assert!(archive(b"program", "sparc64").is_err());
    }
}

//! The files that the boards run: an image alone, or a loader and an image.

use std::path::Path;

use register_map::Row;

use super::Options;
use super::values::OfBoard;

/// The files that a board runs. A file that no option names is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Files<'a> {
    /// An image that runs without a loader.
    Alone(Option<&'a Path>),
    /// The loader, and an image in a slot.
    Loaded {
        /// The loader, an ELF file.
        loader: Option<&'a Path>,
        /// The image.
        image: Option<&'a Path>,
    },
}

impl Options {
    /// Returns the files for a board. For each option the last file for its type counts, or else the last one for all
    /// boards.
    ///
    /// # Errors
    ///
    /// In one line, when the options name an image that runs alone, and also a loader or an image for a slot.
    pub fn files_of(&self, board: &Row) -> Result<Files<'_>, String> {
        let [elf, loader, image] =
            [&self.elf, &self.loader, &self.image].map(|files| last(files, board));
        if elf.is_some() && (loader.is_some() || image.is_some()) {
            return Err(format!(
                "the {board} runs the image of --elf alone: leave out --loader and --image, or --elf"
            ));
        }
        if elf.is_some() || self.no_loader {
            return Ok(Files::Alone(elf));
        }
        Ok(Files::Loaded { loader, image })
    }

    /// Returns the files that no option names, each as its kind and the type of the board.
    ///
    /// # Errors
    ///
    /// In one line, why the simulator cannot run with these options.
    pub fn missing_files(&self) -> Result<Vec<(&'static str, &'static Row)>, String> {
        self.check_line()?;
        let fittings = self.fittings()?;
        let mut missing = Vec::new();
        for board in Row::ALL {
            if !fittings.iter().any(|fitting| fitting.board == board) {
                continue;
            }
            let files = match self.files_of(board)? {
                Files::Alone(elf) => vec![("elf", elf)],
                Files::Loaded { loader, image } => vec![("loader", loader), ("image", image)],
            };
            let unnamed = files.into_iter().filter(|(_, file)| file.is_none());
            missing.extend(unnamed.map(|(kind, _)| (kind, board)));
        }
        Ok(missing)
    }
}

fn last<'a>(files: &'a [OfBoard], board: &Row) -> Option<&'a Path> {
    let named = |wanted: Option<&Row>| files.iter().rev().find(|(of, _)| *of == wanted);
    let (_, path) = named(Some(board)).or_else(|| named(None))?;
    Some(path)
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::super::tests::parse;
    use super::*;

    #[test]
    fn options_of_files_can_name_a_type_of_board() {
        let alone = |path| Ok(Files::Alone(Some(Path::new(path))));
        let arguments = ["--elf", "a", "--elf", "modio-08=b", "--elf", "x=c"];
        let options = parse(&arguments).unwrap();
        assert_eq!(options.files_of(&MODIO_08), alone("b"));
        assert_eq!(options.files_of(&MODIO_02), alone("x=c"));
        let only = parse(&["--elf", "modio-08=b", "--loader", "modio-02=l"]).unwrap();
        let loaded = Files::Loaded {
            loader: Some(Path::new("l")),
            image: None,
        };
        assert_eq!(only.files_of(&MODIO_02), Ok(loaded));
        assert_eq!(only.files_of(&MODIO_08), alone("b"));
        let both = parse(&["--elf", "a", "--image", "b"]).unwrap();
        assert!(both.files_of(&MODIO_02).unwrap_err().contains("leave out"));
    }

    #[test]
    fn missing_files_are_those_of_the_boards_on_the_line() {
        let missing = |arguments: &[&str]| {
            let mut options = parse(arguments).unwrap();
            options.tcp = options.http.into();
            options.missing_files()
        };
        let both = |board| Ok(vec![("loader", board), ("image", board)]);
        assert_eq!(missing(&[]), both(&MODIO_02));
        let other = ["--board", "modio-08", "--elf", "modio-02=a"];
        assert_eq!(missing(&other), both(&MODIO_08));
        assert_eq!(missing(&["--image", "a"]), Ok(vec![("loader", &MODIO_02)]));
        assert_eq!(missing(&["--no-loader"]), Ok(vec![("elf", &MODIO_02)]));
        assert_eq!(missing(&["--elf", "a"]), Ok(vec![]));
        assert!(missing(&["--bus", "nowhere"]).is_err());
    }
}

//! Writes the frames on the line to a capture file: `--record`.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use modbus_line::adu::Framing;
use modbus_line::capture::{Packet, Recorder};
use sim::line::{Frame, Line};

use super::frames;

/// A capture file that is being written.
pub struct Capture {
    path: PathBuf,
    /// The same open file as in `recorder`.
    file: File,
    /// `None` after a write has failed.
    recorder: Option<Recorder<File>>,
    /// Number of the last frame in the file.
    last: u64,
}

impl Capture {
    /// Starts the file at `path`. A file that exists is replaced.
    ///
    /// # Errors
    ///
    /// In one line, why the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, String> {
        let program = concat!("modio-sim ", env!("CARGO_PKG_VERSION"));
        let started = || -> io::Result<Self> {
            let file = File::create(path)?;
            let recorder = Recorder::new(file.try_clone()?, program, "RS-485")?;
            Ok(Self {
                path: path.to_owned(),
                file,
                recorder: Some(recorder),
                last: 0,
            })
        };
        started().map_err(|error| cannot(path, &error))
    }

    /// Writes the frames that have ended since the last call. An error is reported on stderr, and ends the recording.
    pub fn update(&mut self, line: &Line) {
        for frame in line.frames_since(self.last) {
            self.last = frame.number;
            let Some(recorder) = &mut self.recorder else {
                return;
            };
            // The position after the last whole packet. A pipe has none.
            let whole = self.file.stream_position();
            if let Err(error) = write(recorder, frame) {
                // Dropping the recorder flushes its buffer, which may write a part of a packet. So cut the file off
                // after the last whole packet.
                self.recorder = None;
                if let Ok(whole) = whole {
                    let _ = self.file.set_len(whole);
                }
                let what = cannot(&self.path, &error);
                // A closed stderr does not stop the simulator.
                let _ = writeln!(io::stderr(), "modio-sim: {what}; the recording ends");
            }
        }
    }

    /// Returns whether a write has failed, which has ended the recording.
    pub fn failed(&self) -> bool {
        self.recorder.is_none()
    }
}

fn cannot(path: &Path, error: &io::Error) -> String {
    format!("cannot write the capture file {}: {error}", path.display())
}

fn write(recorder: &mut Recorder<File>, frame: &Frame) -> io::Result<()> {
    let mut comment = frames::summary(frame);
    if frame.damaged {
        comment += " (damaged on the line)";
    }
    recorder.write(&Packet {
        time: Duration::from_nanos(frame.start.as_ns()),
        direction: Some(frame.direction),
        framing: Framing::on_line(&frame.bytes).unwrap_or_default(),
        bytes: &frame.bytes,
        comment: &comment,
    })
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use sim::Time;

    use super::*;
    use crate::app::{Origin, testing::scene};

    #[cfg(unix)]
    #[test]
    fn closing_the_reading_end_of_a_pipe_ends_the_recording() {
        let mut scene = scene(Module::Di4);
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let reader = std::thread::spawn({
            let path = path.clone();
            move || File::open(path).unwrap()
        });
        let mut capture = Capture::create(&path).unwrap();
        let mut fails = || {
            scene.send(&[1, 2, 3], Origin::Pty);
            scene.bus.run_for(Time::from_ms(20));
            capture.update(scene.bus.line());
            capture.failed()
        };
        let reader = reader.join().unwrap();
        assert!(!fails());
        drop(reader);
        assert!(fails());
    }
}

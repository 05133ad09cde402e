//! The boards on one line, with their disturbances, the scenario, logs and flash files.

use std::collections::VecDeque;
use std::fmt::Display;
use std::io::Write;

use sim::bus::Bus;
use sim::chip::CYCLE;
use sim::line::Settings;
use sim::slot::BusFault;
use sim::{Board, Channel, Error, Time};

use super::Origin;
use super::action::{Action, Change};
use super::disturbance::Disturbance;
use super::faults::{Faults, HSI_HZ};
use super::gdb::Debug;
use super::scenario::{Input, Known, Scenario};
use super::unit::Unit;

/// The boards on one line and the state of the command that belongs to them.
pub struct Scene {
    /// The boards and their line.
    pub bus: Bus,
    /// Name, log and flash file of each board, in the order of the bus.
    pub units: Vec<Unit>,
    /// Breakpoints and stepping of the debugger.
    pub debug: Debug,
    /// Random disturbances of the line.
    pub disturbance: Disturbance,
    /// Scheduled changes of the boards' surroundings.
    pub scenario: Scenario,
    /// The endpoints that were announced: name and address.
    pub endpoints: Vec<(&'static str, String)>,
    /// The bytes that clients are sending on the line: the end of the last byte, the client, and the bytes.
    sending: VecDeque<(Time, Origin, Vec<u8>)>,
}

impl Scene {
    /// Returns a scene with these boards; at least one.
    pub fn new(boards: Vec<(Board, Unit)>) -> Self {
        let (boards, units) = boards.into_iter().unzip();
        let mut bus = Bus::new(boards);
        // A pty or socket carries no rate, so the client of the line has the unit's rate.
        bus.line().set_follow(true);
        Self {
            bus,
            units,
            debug: Debug::default(),
            disturbance: Disturbance::default(),
            scenario: Scenario::default(),
            endpoints: Vec::new(),
            sending: VecDeque::new(),
        }
    }

    /// Prints an endpoint on stdout, and keeps it for the HTTP interface.
    pub fn announce(&mut self, name: &'static str, address: impl Display) {
        let address = address.to_string();
        say(&format!("{name}: {address}"));
        self.endpoints.push((name, address));
    }

    /// Returns the first board. Requests without the name of a board mean this one.
    pub fn first(&mut self) -> &mut Board {
        self.bus.board_mut(0)
    }

    /// Returns the virtual time.
    pub fn now(&self) -> Time {
        self.bus.now()
    }

    /// Runs until the virtual time is `t`.
    pub fn run_until(&mut self, t: Time) {
        self.pass(t, |bus, until| {
            bus.run_until(until);
            false
        });
    }

    /// Runs the only board to a breakpoint or until `t`. Returns whether it has reached a breakpoint.
    pub fn run_debugged(&mut self, t: Time) -> bool {
        self.pass(t, |bus, until| bus.board_mut(0).run_debugged(until))
    }

    /// Runs up to `t` in slices that end at the instants of the scenario, and queues the disturbances of each slice
    /// first. `run` runs one slice and returns whether to stop there.
    fn pass(&mut self, t: Time, mut run: impl FnMut(&mut Bus, Time) -> bool) -> bool {
        loop {
            let now = self.now();
            self.play(now);
            let until = self.scenario.next().map_or(t, |next| t.min(next));
            self.disturbance.put(self.bus.line(), now, until);
            if run(&mut self.bus, until) {
                return true;
            }
            if until >= t {
                return false;
            }
        }
    }

    /// Carries out the scenario steps that are due at `now`. Reports what a board refuses and continues.
    fn play(&mut self, now: Time) {
        let at_pin = |bus: &Bus, n, input| millivolts(bus.board(n), input);
        while let Some((n, action)) = self
            .scenario
            .take(now, |n, input| at_pin(&self.bus, n, input))
        {
            if let Err(why) = self.apply(n, &action) {
                let name = &self.units[n].name;
                complain(&format!("the scenario at {now}: {name}: {why}"));
            }
        }
    }

    /// Names and ports of the boards, for checking a scenario.
    pub fn known(&self) -> Vec<Known> {
        let boards = self.units.iter().zip(self.bus.boards());
        let known = |(unit, board): (&Unit, &Board)| Known {
            name: unit.name.clone(),
            ports: board.slots().map(|(port, _)| port).collect(),
        };
        boards.map(known).collect()
    }

    /// Applies `action` to board `n` at the present virtual time.
    ///
    /// # Errors
    ///
    /// The reason why the board refuses the action. Nothing has changed then.
    pub fn apply(&mut self, n: usize, action: &Action) -> Result<(), Error> {
        let board = self.bus.board_mut(n);
        let first = board.first_port();
        match *action {
            Action::Channel {
                port,
                channel,
                change,
            } => board.change_slot(port.unwrap_or(first), |slot| match change {
                Change::Energised(on) => slot.set_energised(channel, on),
                Change::Manual(on) => slot.set_manual(channel, on),
                Change::Millivolts(millivolts) => slot.set_millivolts(channel, millivolts),
            })??,
            Action::Terminal { ref name, applied } => board.set_terminal(name, applied.into())?,
            Action::Dip(dip) => board.set_dip(dip),
            Action::PowerOn => board.power_on(),
            Action::PowerOff => board.power_off(),
            Action::Module { port, module } => {
                board.set_module_at(port.unwrap_or(first), module)?;
            }
            Action::Faults(ref faults) => self.make(faults, n)?,
        }
        Ok(())
    }

    /// Applies faults: those of the line and the air, and those of the part on board `n`. The values must have passed
    /// [`Faults::check`].
    fn make(&mut self, faults: &Faults, n: usize) -> Result<(), Error> {
        if let Some(loss) = faults.radio_loss {
            self.bus.air().ok_or(Error::NoRadio)?.set_loss(loss);
        }
        self.disturbance
            .change(faults.bit_error_rate, faults.noise_hz, faults.drop_rate);
        let board = self.bus.board_mut(n);
        if let Some(absent) = faults.i2c_absent {
            let fault = match absent {
                true => BusFault::Absent,
                false => BusFault::None,
            };
            // All DACs of a board are on one I2C bus.
            let ports: Vec<u8> = board.slots().map(|(port, _)| port).collect();
            for port in ports {
                board.change_slot(port, |slot| slot.set_bus_fault(fault))?;
            }
            self.units[n].i2c_absent = absent;
        }
        if let Some(failed) = faults.hse_failed {
            board.set_crystal(!failed);
        }
        if faults.hsi_percent.is_some() || faults.lsi_khz.is_some() {
            let hertz = |value: f64| value.round() as u32;
            let (hsi, lsi) = board.rc_oscillators();
            let percent = faults.hsi_percent;
            let hsi = percent.map_or(hsi, |percent| hertz(HSI_HZ * (1.0 + percent / 100.0)));
            let lsi = faults.lsi_khz.map_or(lsi, |khz| hertz(khz * 1000.0));
            board.set_rc_oscillators(hsi, lsi)?;
        }
        Ok(())
    }

    /// Switches the power of board `n` off, waits 100 ms of virtual time, and switches it on.
    pub fn cycle(&mut self, n: usize) {
        self.bus.board_mut(n).power_off();
        self.run_until(self.now() + CYCLE);
        self.bus.board_mut(n).power_on();
    }

    /// Sets the rate and format of the line's client, which then no longer follows the unit.
    pub fn fix_line(&mut self, settings: Settings) {
        self.bus.line().set_follow(false);
        self.bus.line().set_settings(settings);
    }

    /// Sets the rate of the line's client in bit/s. The format stays the same.
    pub fn set_client_rate(&mut self, baud: u32) {
        let line = self.bus.line();
        let settings = line.settings();
        line.set_settings(Settings { baud, ..settings });
    }

    /// Sends the bytes of a client that are not lost on the way to the line, as [`put`](Self::put) does.
    pub fn send(&mut self, bytes: &[u8], origin: Origin) -> Time {
        let bytes = self.disturbance.not_dropped(bytes.iter().copied());
        self.put(bytes, origin)
    }

    /// Sends bytes on the line now, or directly after the bytes that are still being sent. Returns the end of the last
    /// byte.
    pub fn put(&mut self, bytes: Vec<u8>, origin: Origin) -> Time {
        let now = self.now();
        let end = self.bus.line().send(now, &bytes);
        self.sending.push_back((end, origin, bytes));
        end
    }

    /// Returns the bytes of clients whose last byte has been sent on the line since the last call.
    pub fn take_sent(&mut self) -> Vec<(Origin, Vec<u8>)> {
        let now = self.now();
        let sent = self.sending.partition_point(|(end, ..)| *end <= now);
        let sent = self.sending.drain(..sent);
        sent.map(|(_, origin, bytes)| (origin, self.disturbance.not_dropped(bytes.into_iter())))
            .collect()
    }

    /// Returns the bytes that the master has received since the last call.
    pub fn take_received(&mut self) -> Vec<u8> {
        let received = self.bus.line().take_received();
        let bytes = received.iter().map(|character| character.byte);
        self.disturbance.not_dropped(bytes)
    }

    /// Prints new log lines on stdout and new findings on stderr. With several boards, each line starts with the
    /// board's name.
    pub fn print_news(&mut self) {
        let several = self.units.len() > 1;
        for (n, unit) in self.units.iter_mut().enumerate() {
            let prefix = match several {
                true => format!("{}: ", unit.name),
                false => String::new(),
            };
            let board = self.bus.board_mut(n);
            for line in unit.take_log(board) {
                say(&format!("{prefix}{line}"));
            }
            for finding in unit.take_findings(board) {
                complain(&format!("{prefix}{finding}"));
            }
        }
    }

    /// Updates the flash files. Prints a write error on stderr.
    pub fn keep_flash(&mut self) {
        for (n, unit) in self.units.iter_mut().enumerate() {
            if let Some(file) = &mut unit.flash
                && let Some(error) = file.keep_or_report(self.bus.board(n))
            {
                complain(&error);
            }
        }
    }

    /// Updates the flash files.
    ///
    /// # Errors
    ///
    /// The first write error, in one line.
    pub fn write_flash(&mut self) -> Result<(), String> {
        for (n, unit) in self.units.iter_mut().enumerate() {
            if let Some(file) = &mut unit.flash {
                file.keep(self.bus.board(n))?;
            }
        }
        Ok(())
    }
}

/// Returns the voltage at the pin of an analog input, in mV; `None` for another kind of channel.
fn millivolts(board: &Board, input: Input) -> Option<u16> {
    let mut slots = board.slots();
    let (_, slot) = slots.find(|(port, _)| input.port.is_none_or(|wanted| wanted == *port))?;
    match slot.channel(input.channel) {
        Channel::Ai { millivolts } => Some(millivolts),
        _ => None,
    }
}

/// Prints a line on stdout. A closed stdout does not stop the simulator.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints a line on stderr. A closed stderr does not stop the simulator.
pub fn complain(line: &str) {
    let _ = writeln!(std::io::stderr(), "modio-sim: {line}");
}

#[cfg(test)]
mod tests {
    use register_map::Module;

    use super::*;
    use crate::app::testing::scene;

    #[test]
    fn bytes_of_a_client_are_returned_when_they_have_been_on_the_line() {
        let mut scene = scene(Module::Di4);
        let end = scene.send(&[1, 2, 3], Origin::Pty);
        scene.put(vec![4], Origin::Gateway);
        scene.run_until(end.saturating_sub(Time::from_us(10)));
        assert!(scene.take_sent().is_empty());
        scene.run_until(end);
        let sent = scene.take_sent();
        assert!(matches!(&sent[..], [(Origin::Pty, bytes)] if bytes == &[1, 2, 3]));
        scene.run_until(end + Time::from_ms(2));
        let sent = scene.take_sent();
        assert!(matches!(&sent[..], [(Origin::Gateway, bytes)] if bytes == &[4]));
    }
}

//! Checks of the pseudo-terminals, and of the options that a system without them needs.

use register_map::{Row, board::Second};

use super::{Options, PTY};

impl Options {
    /// Checks that a master can reach the line on this system.
    ///
    /// # Errors
    ///
    /// In one line: the options to use on a system without pseudo-terminals, two pseudo-terminals with the same link, or
    /// a board without an RS-232 socket.
    pub fn check_line(&self) -> Result<(), String> {
        let links = [
            ("--pty", &self.pty),
            ("--lora", &self.lora),
            ("--rs232", &self.rs232),
        ];
        for (n, (one, link)) in links.iter().enumerate() {
            let same = |(_, other): &&(_, _)| link.is_some() && link == other;
            if let Some((other, _)) = links[n + 1..].iter().find(same) {
                return Err(format!("{one} and {other} need different links"));
            }
        }
        if self.rs232.is_some() && !has_socket(self.board) {
            let boards = Row::ALL.into_iter().filter(|board| has_socket(board));
            let boards: Vec<_> = boards.map(|board| board.name).collect();
            return Err(format!(
                "--rs232 needs a board with an RS-232 socket, {}: the {} has none",
                boards.join(" or "),
                self.board
            ));
        }
        if PTY {
            Ok(())
        } else {
            self.reached_without_pty()
        }
    }

    fn reached_without_pty(&self) -> Result<(), String> {
        for (name, link) in [("--lora", &self.lora), ("--rs232", &self.rs232)] {
            if link.is_some() {
                return Err(format!(
                    "the simulator has no pseudo-terminals on this system, so it has no {name}"
                ));
            }
        }
        let ways = [("--tcp", self.tcp), ("--modbus-tcp", self.modbus_tcp)];
        let names = ways.map(|(name, _)| format!("{name} ADDR")).join(" or ");
        let offered = self.exact_line.is_some() || ways.iter().any(|(_, way)| way.is_some());
        if self.pty.is_none() && offered {
            return Ok(());
        }
        Err(format!(
            "the simulator has no pseudo-terminals on this system: offer the RS-485 line with {names} instead, \
             such as --tcp 127.0.0.1:5020"
        ))
    }
}

/// Returns whether a board has an RS-232 socket.
fn has_socket(board: &Row) -> bool {
    board.second == Some(Second::Rs232)
}

#[cfg(test)]
mod tests {
    use super::super::tests::parse;
    use super::*;

    #[test]
    fn without_pseudo_terminals_one_of_the_tcp_options_is_needed() {
        let check = |arguments: &[&str]| parse(arguments).unwrap().reached_without_pty();
        assert_eq!(check(&["--tcp", "127.0.0.1:0"]), Ok(()));
        assert_eq!(check(&["--modbus-tcp", "127.0.0.1:0"]), Ok(()));
        assert_eq!(check(&["--exact-line", "127.0.0.1:0"]), Ok(()));
        for arguments in [&[][..], &["--pty", "x", "--tcp", "127.0.0.1:0"]] {
            let text = check(arguments).unwrap_err();
            assert!(
                text.contains("with --tcp ADDR or --modbus-tcp ADDR instead"),
                "{text}"
            );
        }
        for option in ["--lora", "--rs232"] {
            let text = check(&[option, "x", "--tcp", "127.0.0.1:0"]).unwrap_err();
            assert!(text.ends_with(&format!("no {option}")), "{text}");
        }
        assert_eq!(parse(&[]).unwrap().check_line().is_ok(), PTY);
    }

    #[test]
    fn two_terminals_with_the_same_link_are_refused() {
        for [one, other] in [
            ["--pty", "--lora"],
            ["--pty", "--rs232"],
            ["--lora", "--rs232"],
        ] {
            let same = parse(&[other, "x", one, "x"]).unwrap().check_line();
            let text = format!("{one} and {other} need different links");
            assert_eq!(same.unwrap_err(), text);
        }
    }

    #[test]
    fn rs232_on_a_board_without_the_socket_is_refused() {
        let check = |board| {
            let arguments = ["--board", board, "--rs232", "x", "--pty", "y"];
            parse(&arguments).unwrap().check_line()
        };
        let text = check("modio-02").unwrap_err();
        assert!(text.contains("fx3u-14 or fx3u-24: the modio-02"), "{text}");
        assert!(check("eth-io5r").is_err());
        assert_eq!(check("fx3u-14").is_ok(), PTY);
    }
}

//! Checks of the pseudo-terminals, and of the options that a system without them needs.

use super::{Options, PTY};

impl Options {
    /// Checks that a master can reach the line on this system.
    ///
    /// # Errors
    ///
    /// In one line: the options to use on a system without pseudo-terminals, or two pseudo-terminals with the same
    /// link.
    pub fn check_line(&self) -> Result<(), String> {
        if self.pty.is_some() && self.pty == self.lora {
            return Err("--pty and --lora need different links".to_owned());
        }
        if PTY {
            Ok(())
        } else {
            self.reached_without_pty()
        }
    }

    fn reached_without_pty(&self) -> Result<(), String> {
        if self.lora.is_some() {
            return Err(
                "the simulator has no pseudo-terminals on this system, so it has no --lora"
                    .to_owned(),
            );
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
        let text = check(&["--lora", "x", "--tcp", "127.0.0.1:0"]).unwrap_err();
        assert!(text.contains("no --lora"), "{text}");
        assert_eq!(parse(&[]).unwrap().check_line().is_ok(), PTY);
    }

    #[test]
    fn two_terminals_with_the_same_link_are_refused() {
        let same = parse(&["--pty", "x", "--lora", "x"]).unwrap().check_line();
        assert!(same.unwrap_err().contains("different links"));
    }
}

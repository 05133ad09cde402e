//! Parses the values of options that have several parts.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

use modbus_line::RATES;
use register_map::{Module, Row};

use crate::line::{Format, Settings};

/// A file, for boards of one type or of any.
pub type OfBoard = (Option<&'static Row>, PathBuf);

/// Parses `FILE` or `BOARD=FILE`. A text in front of `=` that is not the name of a board is part of the file's name.
pub fn of_board(text: &str) -> Result<OfBoard, String> {
    let named = text.split_once('=').and_then(|(name, file)| {
        let board: &'static Row = name.parse().ok()?;
        Some((Some(board), PathBuf::from(file)))
    });
    match named.unwrap_or_else(|| (None, PathBuf::from(text))) {
        (_, path) if path.as_os_str().is_empty() => Err("the name of a file is missing".to_owned()),
        named => Ok(named),
    }
}

/// Parses `N` or `N:MODULE`: a unit address and a module.
pub fn unit(text: &str) -> Result<(u8, Option<Module>), String> {
    let (number, module) = match text.split_once(':') {
        Some((number, module)) => (number, Some(module)),
        None => (text, None),
    };
    let number = number
        .parse()
        .map_err(|_| format!("{text:?} is not a unit address and module such as 5:4do"))?;
    let module = module.map(|name| {
        let module = name.parse::<Module>();
        module.map_err(|why| format!("'{name}' is {why}"))
    });
    Ok((number, module.transpose()?))
}

/// Parses `PORT=MODULE`: the number of a port and a module.
///
/// # Errors
///
/// In one line, why `text` is invalid.
pub fn slot(text: &str) -> Result<(u8, Module), String> {
    let wrong = || format!("{text:?} is not a port and module such as 3=4do");
    let (port, module) = text.split_once('=').ok_or_else(wrong)?;
    let port = port.parse().map_err(|_| wrong())?;
    let module = module
        .parse()
        .map_err(|why| format!("'{module}' is {why}"))?;
    Ok((port, module))
}

/// Parses `RATE,FORMAT`: a rate in bit/s, 300 to 4000000, and the name of a format.
pub fn line(text: &str) -> Result<Settings, String> {
    let parsed = text.split_once(',').and_then(|(baud, name)| {
        let baud = baud.parse().ok()?;
        let format = Format::named(&name.to_ascii_uppercase())?;
        let possible = RATES.contains(&i64::from(baud));
        possible.then_some(Settings { baud, format })
    });
    parsed.ok_or_else(|| format!("{text:?} is not a rate and format such as 9600,7N2"))
}

/// Parses `HOST:PORT`. If a name has several addresses, returns the first IPv4 address, because clients try it, too.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let found: Vec<SocketAddr> = text
        .to_socket_addrs()
        .map_err(|error| format!("not an address such as 127.0.0.1:8502: {error}"))?
        .collect();
    found
        .iter()
        .find(|address| address.is_ipv4())
        .or(found.first())
        .copied()
        .ok_or_else(|| "the name has no address".to_owned())
}

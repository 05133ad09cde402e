//! Refuses changes by foreign web pages.
//!
//! Any web page in a browser on this computer can send requests to the simulator. The page's owner can also let a
//! domain name of the page point to this computer. The headers `Host` and `Origin` show both.

use std::net::{IpAddr, SocketAddr};

use axum::http::uri::Authority;
use axum::http::{HeaderMap, Uri, header};

/// Checks the headers of requests that change something.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    bound: IpAddr,
}

impl Guard {
    /// Returns the guard of a server at this address.
    pub const fn new(address: SocketAddr) -> Self {
        Self {
            bound: address.ip(),
        }
    }

    /// Checks that a request with these headers may change something.
    ///
    /// # Errors
    ///
    /// The reason why the request must be refused.
    pub fn check(&self, headers: &HeaderMap) -> Result<(), &'static str> {
        let host: Authority = headers
            .get(header::HOST)
            .and_then(|host| host.to_str().ok()?.parse().ok())
            .ok_or("the header `Host` is missing or invalid")?;
        if !self.is_here(host.host()) {
            return Err("the header `Host` is neither a loopback name nor the simulator's address");
        }
        let same = |origin: &Uri| origin.authority() == Some(&host);
        match headers.get(header::ORIGIN) {
            None => Ok(()),
            Some(origin) => origin
                .to_str()
                .ok()
                .and_then(|origin| origin.parse().ok())
                .filter(same)
                .map(|_| ())
                .ok_or(
                    "the header `Origin` is not the simulator: other pages may not change anything",
                ),
        }
    }

    fn is_here(&self, host: &str) -> bool {
        let Ok(address) = host
            .trim_start_matches('[')
            .trim_end_matches(']')
            .parse::<IpAddr>()
        else {
            return host.eq_ignore_ascii_case("localhost");
        };
        // A server that is bound to all addresses does not know them, so it accepts every IP address. A domain name is
        // refused above.
        address.is_loopback() || address == self.bound || self.bound.is_unspecified()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn may(bound: &str, host: &str, origin: Option<&str>) -> bool {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        Guard::new(bound.parse().unwrap()).check(&headers).is_ok()
    }

    #[test]
    fn host_must_be_a_loopback_name_or_the_bound_address() {
        let loopback = "127.0.0.1:8502";
        for host in [
            "127.0.0.1:8502",
            "localhost:8502",
            "LOCALHOST",
            "[::1]:8502",
            "127.0.0.7",
        ] {
            assert!(may(loopback, host, None), "{host}");
        }
        for host in [
            "example.org",
            "127.0.0.1.example.org:8502",
            "localhost.example.org",
            "192.168.1.7:8502",
            "a b",
            "",
        ] {
            assert!(!may(loopback, host, None), "{host}");
        }
        assert!(may("192.168.1.7:8502", "192.168.1.7:8502", None));
        assert!(!may("192.168.1.7:8502", "192.168.1.8:8502", None));
        assert!(may("0.0.0.0:8502", "192.168.1.8:8502", None));
        assert!(!may("0.0.0.0:8502", "example.org:8502", None));
        let none = HeaderMap::new();
        assert!(Guard::new(loopback.parse().unwrap()).check(&none).is_err());
    }

    #[test]
    fn origin_must_be_the_host() {
        let may = |origin| may("127.0.0.1:8502", "localhost:8502", Some(origin));
        assert!(may("http://localhost:8502"));
        for origin in [
            "http://localhost:8503",
            "http://localhost",
            "http://127.0.0.1:8502",
            "https://example.org",
            "null",
            "",
        ] {
            assert!(!may(origin), "{origin}");
        }
    }
}

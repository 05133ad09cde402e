//! Who may change something. A page from anywhere can have a browser on this computer send requests to the simulator,
//! even under a domain name of that page, which its owner lets point to this computer. Both show in the headers `Host` and `Origin`.

use std::net::{IpAddr, SocketAddr};

use axum::http::uri::Authority;
use axum::http::{HeaderMap, Uri, header};

/// What the headers of a request that changes something must say.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    bound: IpAddr,
}

impl Guard {
    /// For a server at this address.
    pub const fn new(address: SocketAddr) -> Self {
        Self {
            bound: address.ip(),
        }
    }

    /// Whether a request with these headers may change something.
    ///
    /// # Errors
    ///
    /// Why it may not.
    pub fn check(&self, headers: &HeaderMap) -> Result<(), &'static str> {
        let host: Authority = headers
            .get(header::HOST)
            .and_then(|host| host.to_str().ok()?.parse().ok())
            .ok_or("the request has no good `Host`")?;
        if !self.is_here(host.host()) {
            return Err("`Host` is neither a loopback name nor the simulator's address");
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
                .ok_or("`Origin` is not the simulator: another page may not change anything"),
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
        // Bound to all addresses of the computer, it cannot know them; a name that somebody lets point here is none.
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
    fn only_loopback_names_and_the_bound_address_are_good_hosts() {
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
    fn an_origin_must_be_the_host() {
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

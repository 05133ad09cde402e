//! The picture of the latencies in docs/fast-modbus.md.

use std::fmt::Write;

/// Size of a panel, and the space around it.
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 56.0;
/// Decades of the axis of times, from 1 ms on, and bars in a decade.
const DECADES: f64 = 3.0;
const BARS: usize = 20;

/// Latencies in us, of events and of polling.
pub struct Panel {
    pub baud: u32,
    pub events: Vec<f64>,
    pub polling: Vec<f64>,
}

/// Returns the histograms of the panels, one below the other, as an SVG.
pub fn svg(panels: &[Panel]) -> String {
    let height = TOP + panels.len() as f64 * (HEIGHT + 60.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{LEFT}\" y=\"22\">Time from an edge until the master knows it, thirty units (share of the edges)</text>\n",
        LEFT + WIDTH + 30.0
    );
    for (n, panel) in panels.iter().enumerate() {
        let top = TOP + n as f64 * (HEIGHT + 60.0);
        draw(&mut out, panel, top);
    }
    out + "</svg>\n"
}

fn draw(out: &mut String, panel: &Panel, top: f64) {
    let bottom = top + HEIGHT;
    let series = [
        (
            "events (function 70)",
            "#1f77b4",
            histogram(&panel.events),
            0.0,
        ),
        ("polling", "#d95f02", histogram(&panel.polling), 150.0),
    ];
    let most = series
        .iter()
        .flat_map(|(_, _, bars, _)| bars)
        .copied()
        .fold(0.0, f64::max);
    for (name, colour, bars, shift) in series {
        let width = WIDTH / bars.len() as f64;
        for (bar, share) in bars.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let (x, tall) = (LEFT + bar as f64 * width, share / most * HEIGHT);
            let y = bottom - tall;
            _ = writeln!(
                out,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{tall:.1}\" fill=\"{colour}\" fill-opacity=\"0.65\"/>"
            );
        }
        let (x, y) = (LEFT + 120.0 + shift, top - 6.0);
        _ = writeln!(
            out,
            "<text x=\"{x}\" y=\"{y}\" fill=\"{colour}\">{name}</text>"
        );
    }
    _ = writeln!(
        out,
        "<text x=\"{LEFT}\" y=\"{}\">{} bit/s</text>",
        top - 6.0,
        panel.baud
    );
    _ = writeln!(
        out,
        "<path d=\"M{LEFT} {top}V{bottom}H{}\" fill=\"none\" stroke=\"#333\"/>",
        LEFT + WIDTH
    );
    _ = writeln!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{:.0} %</text>",
        LEFT - 6.0,
        top + 10.0,
        most * 100.0
    );
    for (decade, name) in ["1 ms", "10 ms", "100 ms", "1 s"].iter().enumerate() {
        let x = LEFT + decade as f64 / DECADES * WIDTH;
        _ = writeln!(out, "<path d=\"M{x:.1} {bottom}v5\" stroke=\"#333\"/>");
        _ = writeln!(
            out,
            "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{name}</text>",
            bottom + 19.0
        );
    }
}

/// Returns the share of the times in each bar; longer ones count in the last bar, shorter ones in the first.
fn histogram(times: &[f64]) -> Vec<f64> {
    let count = DECADES as usize * BARS;
    let mut bars = vec![0.0; count];
    for us in times {
        let bar = (us / 1_000.0).log10() * BARS as f64;
        bars[(bar.max(0.0) as usize).min(count - 1)] += 1.0 / times.len() as f64;
    }
    bars
}

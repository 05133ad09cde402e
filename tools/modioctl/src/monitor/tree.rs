//! The tree of ports and points: its selection, open ports and window.

use std::collections::BTreeSet;

use crate::names::{Item, PortItems};

/// A row of the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Row<'a> {
    Port(&'a PortItems),
    Point(&'a Item),
}

impl Row<'_> {
    /// Returns the name that distinguishes the row: `p5`, `p5.1`.
    pub fn name(&self) -> String {
        match self {
            Row::Port(port) => format!("p{}", port.number),
            Row::Point(item) => item.name.clone(),
        }
    }
}

/// The tree.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    ports: Vec<PortItems>,
    closed: BTreeSet<u8>,
    selected: usize,
    offset: usize,
}

impl Tree {
    /// Sets the ports of a unit. The selection stays at the row with the same name.
    pub fn set(&mut self, ports: Vec<PortItems>) {
        let name = self.selected().map(|row| row.name());
        self.ports = ports;
        let rows = self.rows();
        let same = rows.iter().position(|row| Some(row.name()) == name);
        let point = || rows.iter().position(|row| matches!(row, Row::Point(_)));
        self.selected = same.or_else(point).unwrap_or(0);
    }

    /// Returns the ports.
    pub fn ports(&self) -> &[PortItems] {
        &self.ports
    }

    /// Returns the rows, without the points of ports that are closed.
    pub fn rows(&self) -> Vec<Row<'_>> {
        let rows = self.ports.iter().flat_map(|port| {
            let open = self.is_open(port.number);
            let points = port.points.iter().filter(move |_| open).map(Row::Point);
            std::iter::once(Row::Port(port)).chain(points)
        });
        rows.collect()
    }

    /// Returns whether the points of a port are shown.
    pub fn is_open(&self, port: u8) -> bool {
        !self.closed.contains(&port)
    }

    /// Opens or closes a port.
    pub fn set_open(&mut self, port: u8, open: bool) {
        if open {
            self.closed.remove(&port);
        } else {
            self.closed.insert(port);
        }
    }

    /// Opens a port that is closed, or closes it.
    pub fn toggle(&mut self, port: u8) {
        self.set_open(port, !self.is_open(port));
    }

    /// Returns the port that is selected; `None` for a point.
    pub fn port(&self) -> Option<u8> {
        match self.selected()? {
            Row::Port(port) => Some(port.number),
            Row::Point(_) => None,
        }
    }

    /// Returns the row that is selected.
    pub fn selected(&self) -> Option<Row<'_>> {
        self.rows().get(self.selected).copied()
    }

    /// Returns the index of the selected row.
    pub const fn index(&self) -> usize {
        self.selected
    }

    /// Selects a row, or the last one when there are fewer.
    pub fn select(&mut self, index: usize) {
        self.selected = index.min(self.rows().len().saturating_sub(1));
    }

    /// Moves the selection; a negative number moves it upwards.
    pub fn move_by(&mut self, by: isize) {
        self.select(self.selected.saturating_add_signed(by));
    }

    /// Selects the port of the selected point.
    pub fn select_port(&mut self) {
        let rows = self.rows();
        let above = rows.iter().take(self.selected + 1);
        let port = above
            .enumerate()
            .rfind(|(_, row)| matches!(row, Row::Port(_)));
        if let Some((index, _)) = port {
            self.selected = index;
        }
    }

    /// Returns the index of the first row in a window of this height, so that the selected row is inside.
    pub fn scrolled(&mut self, height: usize) -> usize {
        let most = self.rows().len().saturating_sub(height);
        let least = (self.selected + 1).saturating_sub(height);
        self.offset = self.offset.clamp(least, self.selected.max(least)).min(most);
        self.offset
    }

    /// Returns the index of the first row in the window, as it was drawn.
    pub const fn offset(&self) -> usize {
        self.offset
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

    use super::*;
    use crate::names::book;

    fn tree(module: Module) -> Tree {
        let mut tree = Tree::default();
        tree.set(book(&MODIO_08, module, (0, 0)).ports());
        tree
    }

    fn selected(tree: &Tree) -> String {
        tree.selected().map(|row| row.name()).unwrap_or_default()
    }

    #[test]
    fn selection_moves_over_ports_and_points_and_stays_inside() {
        let mut tree = tree(Module::Do4);
        assert_eq!(
            (tree.rows().len(), selected(&tree)),
            (20, "p1.1".to_owned())
        );
        tree.move_by(4);
        assert_eq!(selected(&tree), "p2");
        tree.move_by(-100);
        assert_eq!(selected(&tree), "p1");
        tree.select(1000);
        assert_eq!(selected(&tree), "p4.4");
        tree.select_port();
        assert_eq!(selected(&tree), "p4");
        tree.set_open(4, false);
        assert_eq!(tree.rows().len(), 16);
    }

    #[test]
    fn window_follows_the_selection() {
        let mut tree = tree(Module::Do4);
        tree.select(19);
        assert_eq!(tree.scrolled(8), 12);
        tree.select(13);
        assert_eq!(tree.scrolled(8), 12);
        tree.select(0);
        assert_eq!(tree.scrolled(8), 0);
        assert_eq!(tree.scrolled(0), 1);
        assert_eq!(tree.scrolled(100), 0);
    }

    #[test]
    fn other_modules_keep_the_selection_by_name() {
        let mut tree = tree(Module::Do4);
        tree.select(7);
        assert_eq!(selected(&tree), "p2.2");
        tree.set(book(&MODIO_08, Module::Ai4, (0, 0)).ports());
        assert_eq!(selected(&tree), "p2.2");
        tree.set(book(&MODIO_08, Module::None, (0, 0)).ports());
        assert_eq!(selected(&tree), "p1");
        tree.set(Vec::new());
        assert_eq!(tree.selected(), None);
        tree.move_by(1);
        assert_eq!(tree.scrolled(5), 0);
    }
}

//! Nodes and elements of version 2.

use super::{Reader, Result, end};
use crate::import::scan::Scalar;

impl Reader<'_> {
    /// `number x y z`
    pub(super) fn nodes_2(&mut self) -> Result<()> {
        let count: i64 = self.scan.number("the number of nodes")?;
        if self.scan.binary {
            self.scan.line();
        }
        let count = self.scan.room(count, if self.scan.binary { 28 } else { 8 }, "nodes")?;
        self.mesh.reserve(count, 0);
        let mut tags = Vec::with_capacity(count);
        for _ in 0..count {
            tags.push(self.scan.integer(Scalar::I32, "the number of a node")?);
            let position = self.position()?;
            self.mesh.vertex(position);
        }
        self.finish_nodes(tags)?;
        end(&mut self.scan, "$EndNodes")
    }

    /// ASCII: `number type tags... nodes...`. Binary: blocks of elements of one type and one number of tags.
    ///
    /// The first tag is the physical group. A surface in two groups is written twice, turned over where the group says
    /// so.
    pub(super) fn elements_2(&mut self) -> Result<()> {
        let count: i64 = self.scan.number("the number of elements")?;
        if self.scan.binary {
            self.scan.line();
        }
        let count = self.scan.room(count, if self.scan.binary { 8 } else { 4 }, "elements")?;
        let mut numbers = Vec::new();
        let mut done = 0;
        while done < count {
            self.scan.skip_space_of_text();
            let mut start = self.scan.pos;
            if !self.scan.binary {
                self.scan.integer(Scalar::I32, "the number of an element")?;
            }
            let number = self.scan.integer(Scalar::I32, "the type of an element")?;
            let (kind, nodes) = self.known(number, start)?;
            let follow = if self.scan.binary { self.scan.integer(Scalar::I32, "a number of elements")? } else { 1 };
            let tags = self.scan.integer(Scalar::I32, "the number of tags of an element")?;
            let tags = self.scan.room(tags, if self.scan.binary { 0 } else { 2 }, "tags of an element")?;
            let width = if self.scan.binary { 4 * (1 + tags.min(self.scan.remaining()) + nodes) } else { 2 * nodes };
            let follow = self.scan.room(follow, width, "elements")?;
            if follow == 0 {
                return Err(self.scan.invalid(start, "a block of no elements: save the mesh again"));
            }
            for _ in 0..follow {
                if self.scan.binary {
                    start = self.scan.pos;
                    self.scan.integer(Scalar::I32, "the number of an element")?;
                }
                numbers.clear();
                for _ in 0..tags {
                    numbers.push(self.scan.integer(Scalar::I32, "a tag of an element")?);
                }
                let physical = numbers.first().copied().unwrap_or(0);
                numbers.clear();
                for _ in 0..nodes {
                    numbers.push(self.scan.integer(Scalar::I32, "a node of an element")?);
                }
                let surface = matches!(kind, super::Kind::Triangle | super::Kind::Quadrilateral);
                let group = if surface { self.group(physical) } else { None };
                self.add(kind, &numbers, group, physical < 0, start)?;
            }
            done += follow;
        }
        end(&mut self.scan, "$EndElements")
    }
}

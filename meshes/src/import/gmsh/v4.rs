//! Entities, nodes and elements of version 4.1.

use super::{Kind, Reader, Result, end};
use crate::import::scan::Scalar;

/// Most physical groups that a surface may be in: ten times what anyone needs, and few enough that a damaged file
/// cannot multiply its triangles without bound.
const MOST_GROUPS: usize = 32;

impl Reader<'_> {
    fn int(&mut self, expected: &str) -> Result<i64> {
        self.scan.integer(Scalar::I32, expected)
    }

    /// A `size_t`.
    fn size(&mut self, expected: &str) -> Result<i64> {
        self.scan.integer(self.size, expected)
    }

    /// A count of things of which each takes this many bytes in a binary file, and this many characters at least as
    /// text.
    fn count(&mut self, what: &'static str, binary: usize, text: usize) -> Result<usize> {
        let count = self.size(what)?;
        self.scan.room(count, if self.scan.binary { binary } else { text }, what)
    }

    /// Binary data begin on the line after the name of the section.
    fn begin(&mut self) {
        if self.scan.binary {
            self.scan.line();
        }
    }

    /// A counted list of `int`.
    fn ints(&mut self, what: &'static str) -> Result<Vec<i64>> {
        let count = self.count(what, 4, 2)?;
        (0..count).map(|_| self.int(what)).collect()
    }

    /// The geometry behind the mesh, of which only the physical groups of surfaces are kept.
    ///
    /// In a partitioned mesh the elements belong to parts of the original entities, which are listed in a section of
    /// their own with the original's groups.
    pub(super) fn entities(&mut self, partitioned: bool) -> Result<()> {
        self.begin();
        if partitioned {
            self.size("the number of partitions")?;
            for _ in 0..self.count("ghost entities", 8, 4)? {
                self.int("the number of a ghost entity")?;
                self.int("the partition of a ghost entity")?;
            }
        }
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = self.count("geometrical entities", 16, 6)?;
        }
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = self.int("the number of a geometrical entity")?;
                if partitioned {
                    self.int("the dimension of a parent entity")?;
                    self.int("the number of a parent entity")?;
                    self.ints("partitions of an entity")?;
                }
                // The position of a point, the bounding box of anything else.
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.scan.real(Scalar::F64, "a coordinate of an entity")?;
                }
                let physical = self.ints("physical groups of an entity")?;
                if physical.len() > MOST_GROUPS {
                    let problem = format!("surface {tag} is in {} physical groups: one is enough", physical.len());
                    return Err(self.scan.invalid(self.scan.pos, problem));
                }
                if dimension == 2 && !physical.is_empty() {
                    self.physical.insert(tag, physical);
                }
                if dimension > 0 {
                    self.ints("boundaries of an entity")?;
                }
            }
        }
        end(&mut self.scan, if partitioned { "$EndPartitionedEntities" } else { "$EndEntities" })
    }

    /// Blocks of nodes: first all tags of the block, then all positions.
    pub(super) fn nodes_4(&mut self) -> Result<()> {
        self.begin();
        let blocks = self.count("blocks of nodes", 20, 8)?;
        let total = self.count("nodes", 32, 8)?;
        self.size("the smallest node number")?;
        self.size("the largest node number")?;
        self.mesh.reserve(total, 0);
        let mut tags = Vec::with_capacity(total);
        for _ in 0..blocks {
            let dimension = self.int("the dimension of an entity")?;
            self.int("the number of an entity")?;
            let parametric = self.int("0 or 1 for parametric nodes")?;
            // Nodes on curves and surfaces may carry their one, two or three parameters.
            let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
            let count = self.count("nodes of a block", 32, 8)?;
            for _ in 0..count {
                tags.push(self.size("the number of a node")?);
            }
            for _ in 0..count {
                let position = self.position()?;
                self.mesh.vertex(position);
                for _ in 0..parameters {
                    self.scan.real(Scalar::F64, "a parameter of a node")?;
                }
            }
        }
        if tags.len() != total {
            let problem = format!("the blocks hold {} nodes, {total} were announced: save the mesh again", tags.len());
            return Err(self.scan.invalid(self.scan.pos, problem));
        }
        self.finish_nodes(tags)?;
        end(&mut self.scan, "$EndNodes")
    }

    /// Blocks of elements of one type on one entity.
    pub(super) fn elements_4(&mut self) -> Result<()> {
        self.begin();
        let blocks = self.count("blocks of elements", 16, 8)?;
        let total = self.count("elements", 12, 4)?;
        self.size("the smallest element number")?;
        self.size("the largest element number")?;
        let mut nodes = Vec::new();
        let mut done = 0;
        for _ in 0..blocks {
            self.scan.skip_space_of_text();
            let start = self.scan.pos;
            let dimension = self.int("the dimension of an entity")?;
            let entity = self.int("the number of an entity")?;
            let number = self.int("the type of an element")?;
            let (kind, width) = self.known(number, start)?;
            let count = self.count("elements of a block", (1 + width) * self.size.size(), 2 * (1 + width))?;
            let groups = self.groups_of_entity(dimension, entity);
            self.mesh.reserve(0, if kind == Kind::Triangle { count * groups.len() } else { 0 });
            for _ in 0..count {
                self.scan.skip_space_of_text();
                let start = self.scan.pos;
                self.size("the number of an element")?;
                nodes.clear();
                for _ in 0..width {
                    nodes.push(self.size("a node of an element")?);
                }
                // A surface in two groups counts in both, as in version 2; `clean` drops what is there twice.
                for &(group, turned) in &groups {
                    self.add(kind, &nodes, group, turned, start)?;
                }
            }
            done += count;
        }
        if done != total {
            let problem = format!("the blocks hold {done} elements, {total} were announced: save the mesh again");
            return Err(self.scan.invalid(self.scan.pos, problem));
        }
        end(&mut self.scan, "$EndElements")
    }

    /// Physical groups of an entity, and whether each takes it turned over. One entry without a group if there is none.
    fn groups_of_entity(&mut self, dimension: i64, entity: i64) -> Vec<(Option<u32>, bool)> {
        let physical = match self.physical.get(&entity) {
            Some(physical) if dimension == 2 => physical.clone(),
            _ => vec![0],
        };
        physical.into_iter().map(|tag| (self.group(tag), tag < 0)).collect()
    }
}

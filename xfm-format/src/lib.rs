//! The `.xfm` file: a pageable merge-tree forest, its writer, reader and verifier.
//!
//! `FORMAT.md` beside this crate's manifest is the format's only specification. In short: trees are cut into *blocks*,
//! connected pieces of a few nodes, and blocks are gathered into compressed *pages* of up to a thousand nodes, connected
//! pieces too, such that a path from a root down passes few pages. A node's id in the file says in which block it lies, and
//! where there; see [`Numbering`]. Everything in a file is covered by a checksum, and nothing in it is trusted.
//!
//! [`write()`] takes a forest in memory, [`FileWriter`] one of any size, page by page.
//!
//! ```
//! use halfedge::{HalfEdgeMesh, VertexId};
//! use mergetree::{CollapseRecord, Forest, OctNormal, StarBounds};
//! use xfm_format::{WriteOptions, XfmFile, verify, write};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("octahedron.xfm");
//! // An octahedron with one vertex collapsed.
//! let triangles =
//!     [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]];
//! let positions = [[0., 0., 1.], [1., 0., 0.], [0., 1., 0.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]]
//!     .map(glam::Vec3::from_array);
//! let mut mesh = HalfEdgeMesh::from_triangles(6, &triangles)?;
//! let h = mesh.outgoing(VertexId::new(0)).next().unwrap();
//! let collapse = mesh.check_collapse(h)?;
//! mesh.apply(&collapse);
//! let record = CollapseRecord::new(&collapse, StarBounds::default());
//! let forest = Forest::from_records(&[record], &mesh, &positions, &positions.map(OctNormal::new))?;
//!
//! let report = write(&forest, &path, &WriteOptions::default())?;
//! assert_eq!((report.blocks, report.pages), (1, 1));
//!
//! let file = XfmFile::open(&path)?;
//! assert_eq!(file.header().input_triangles, 8);
//! assert_eq!(file.read_page(0)?.nodes()[0].position, positions[0]);
//! assert!(verify(&file, |_| {}).errors.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bounds;
mod codec;
mod column;
mod error;
mod file_writer;
mod header;
mod layout;
mod numbering;
mod page;
mod reader;
mod rounding;
mod sections;
mod storage;
mod temporary;
mod verify;
mod write;

pub use codec::FieldBytes;
pub use error::{Error, Place};
pub use file_writer::{FileWriter, PositionError, Totals, WriteOptions, WriteReport};
pub use header::{Attribute, AttributeCoding, AttributeType, Encoding, Header, Precision, VERSION};
pub use numbering::{BlockId, Numbering};
pub use page::{Block, Page};
pub use reader::{PageReader, XfmFile};
pub use rounding::Rounding;
pub use storage::Storage;
pub use verify::{Problem, Progress, Report, verify};
pub use write::write;

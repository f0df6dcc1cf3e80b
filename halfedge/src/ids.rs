//! Index newtypes with a niche, so that `Option<Id>` takes four bytes.

/// Defines an index newtype: `define_id!(/** doc */ NodeId, "n");`, the letter being what stands before the number in
/// its `Debug` output.
#[macro_export]
macro_rules! define_id {
    ($(#[$doc:meta])* $name:ident, $letter:literal) => {
        $(#[$doc])*
        ///
        /// Any `u32` but [`u32::MAX`]; `Option` of it takes four bytes.
        #[derive(Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(transparent)]
        pub struct $name(std::num::NonZeroU32);

        impl $name {
            /// The id with this index.
            ///
            /// # Panics
            /// When `index` is [`u32::MAX`], which stands for "none".
            #[inline]
            pub const fn new(index: u32) -> Self {
                match std::num::NonZeroU32::new(!index) {
                    Some(bits) => Self(bits),
                    None => panic!("index u32::MAX is reserved"),
                }
            }

            /// The id with this index, as `usize`.
            ///
            /// # Panics
            /// When `index` does not fit.
            #[inline]
            pub fn from_index(index: usize) -> Self {
                Self::new(u32::try_from(index).expect("more elements than 32-bit ids can name"))
            }

            /// The index as `u32`.
            #[inline]
            pub const fn get(self) -> u32 {
                !self.0.get()
            }

            /// The index, for slices.
            #[inline]
            pub const fn index(self) -> usize {
                self.get() as usize
            }
        }

        impl PartialOrd for $name {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }

        impl Ord for $name {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                self.get().cmp(&other.get())
            }
        }

        impl std::fmt::Debug for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, concat!($letter, "{}"), self.get())
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{}", self.get())
            }
        }

        const _: () = assert!(size_of::<Option<$name>>() == 4);
    };
}

define_id!(
    /// A vertex.
    VertexId,
    "v"
);
define_id!(
    /// A triangle; its half-edges are `3f`, `3f + 1`, `3f + 2`.
    FaceId,
    "f"
);
define_id!(
    /// A directed edge `h = 3f + i`, running counter-clockwise from corner `i` of face `f` to the next corner.
    HalfEdgeId,
    "h"
);

impl FaceId {
    /// Half-edge of corner `corner` (0, 1 or 2).
    #[inline]
    pub const fn half_edge(self, corner: u32) -> HalfEdgeId {
        HalfEdgeId::new(3 * self.get() + corner)
    }

    /// The three half-edges, counter-clockwise.
    #[inline]
    pub const fn half_edges(self) -> [HalfEdgeId; 3] {
        [self.half_edge(0), self.half_edge(1), self.half_edge(2)]
    }
}

impl HalfEdgeId {
    /// The face this half-edge belongs to.
    #[inline]
    pub const fn face(self) -> FaceId {
        FaceId::new(self.get() / 3)
    }

    /// The corner of its face, 0, 1 or 2.
    #[inline]
    pub const fn corner(self) -> u32 {
        self.get() % 3
    }

    /// The next half-edge around the face, counter-clockwise.
    #[inline]
    pub const fn next(self) -> Self {
        if self.corner() == 2 { Self::new(self.get() - 2) } else { Self::new(self.get() + 1) }
    }

    /// The previous half-edge around the face.
    #[inline]
    pub const fn prev(self) -> Self {
        if self.corner() == 0 { Self::new(self.get() + 2) } else { Self::new(self.get() - 1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn next_and_prev_stay_in_the_face_and_are_inverse() {
        for index in 0..30 {
            let h = HalfEdgeId::new(index);
            assert_eq!(h.next().face(), h.face());
            assert_eq!(h.next().prev(), h);
            assert_eq!(h.next().next().next(), h);
            assert_eq!(h.face().half_edge(h.corner()), h);
        }
    }

    #[test]
    fn order_follows_the_index() {
        assert!(VertexId::new(3) < VertexId::new(4));
        assert_eq!(VertexId::from_index(7).get(), 7);
    }
}

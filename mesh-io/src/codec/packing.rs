//! gzip and Zstandard, in and out.

use std::io::{self, Chain, Cursor, Read, Write};

use crate::{Error, Packing};

/// The bytes looked at first, and then the rest.
type Rewound<R> = Chain<Cursor<Vec<u8>>, R>;

/// A reader that unpacks what is packed.
pub(crate) enum Unpacked<R: Read> {
    Plain(Rewound<R>),
    #[cfg(feature = "gz")]
    Gzip(Box<flate2::read::MultiGzDecoder<io::BufReader<Rewound<R>>>>),
    #[cfg(feature = "zst")]
    Zstd(Box<zstd::stream::read::Decoder<'static, io::BufReader<Rewound<R>>>>),
}

impl<R: Read> Unpacked<R> {
    /// Looks at the first bytes and unpacks accordingly.
    pub(crate) fn new(mut reader: R, name: &str) -> Result<Self, Error> {
        let mut first = Vec::with_capacity(4);
        reader.by_ref().take(4).read_to_end(&mut first).map_err(|e| Error::io(name, "read", e))?;
        let packing = Packing::from_magic(&first);
        let reader = Cursor::new(first).chain(reader);
        match packing {
            Packing::None => Ok(Self::Plain(reader)),
            #[cfg(feature = "gz")]
            Packing::Gzip => {
                let reader = io::BufReader::with_capacity(1 << 16, reader);
                Ok(Self::Gzip(Box::new(flate2::read::MultiGzDecoder::new(reader))))
            }
            #[cfg(not(feature = "gz"))]
            Packing::Gzip => {
                Err(Error::FeatureDisabled { name: name.to_owned(), what: "gzip", feature: "gz" })
            }
            #[cfg(feature = "zst")]
            Packing::Zstd => zstd::stream::read::Decoder::new(reader)
                .map(|decoder| Self::Zstd(Box::new(decoder)))
                .map_err(|error| Error::io(name, "unpack", error)),
            #[cfg(not(feature = "zst"))]
            Packing::Zstd => Err(Error::FeatureDisabled {
                name: name.to_owned(),
                what: "Zstandard",
                feature: "zst",
            }),
        }
    }

    pub(crate) fn is_plain(&self) -> bool {
        matches!(self, Self::Plain(_))
    }
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(reader) => reader.read(out),
            #[cfg(feature = "gz")]
            Self::Gzip(reader) => reader.read(out),
            #[cfg(feature = "zst")]
            Self::Zstd(reader) => reader.read(out),
        }
    }
}

/// A writer that packs what the file's name asks to be packed.
pub(crate) enum Packed<W: Write> {
    Plain(W),
    #[cfg(feature = "gz")]
    Gzip(flate2::write::GzEncoder<W>),
    #[cfg(feature = "zst")]
    Zstd(zstd::stream::write::Encoder<'static, W>),
}

impl<W: Write> Packed<W> {
    pub(crate) fn new(writer: W, packing: Packing, name: &str) -> Result<Self, Error> {
        match packing {
            Packing::None => Ok(Self::Plain(writer)),
            #[cfg(feature = "gz")]
            Packing::Gzip => Ok(Self::Gzip(flate2::write::GzEncoder::new(
                writer,
                flate2::Compression::default(),
            ))),
            #[cfg(not(feature = "gz"))]
            Packing::Gzip => {
                Err(Error::FeatureDisabled { name: name.to_owned(), what: "gzip", feature: "gz" })
            }
            #[cfg(feature = "zst")]
            Packing::Zstd => zstd::stream::write::Encoder::new(writer, 3)
                .map(Self::Zstd)
                .map_err(|error| Error::io(name, "pack", error)),
            #[cfg(not(feature = "zst"))]
            Packing::Zstd => Err(Error::FeatureDisabled {
                name: name.to_owned(),
                what: "Zstandard",
                feature: "zst",
            }),
        }
    }

    /// Writes what the packer holds back and returns the writer.
    pub(crate) fn finish(self) -> io::Result<W> {
        match self {
            Self::Plain(writer) => Ok(writer),
            #[cfg(feature = "gz")]
            Self::Gzip(encoder) => encoder.finish(),
            #[cfg(feature = "zst")]
            Self::Zstd(encoder) => encoder.finish(),
        }
    }
}

impl<W: Write> Write for Packed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(writer) => writer.write(bytes),
            #[cfg(feature = "gz")]
            Self::Gzip(encoder) => encoder.write(bytes),
            #[cfg(feature = "zst")]
            Self::Zstd(encoder) => encoder.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(writer) => writer.flush(),
            #[cfg(feature = "gz")]
            Self::Gzip(encoder) => encoder.flush(),
            #[cfg(feature = "zst")]
            Self::Zstd(encoder) => encoder.flush(),
        }
    }
}

//! Entropy coding of a page: symbols by range asymmetric numeral systems with tables that the page has, and plain bits.
//!
//! # Sources
//! Duda, *Asymmetric numeral systems: entropy coding combining speed of Huffman coding with compression rate of arithmetic
//! coding*, 2013; Giesen, *Interleaved entropy coders*, 2014.

use crate::column::{Cursor, push_varint};
use crate::error::Defect;

/// Frequencies of a table add up to two to this power.
const FREQUENCY_BITS: u32 = 10;
const FREQUENCIES: u32 = 1 << FREQUENCY_BITS;
/// Lower end of a state; it has so many more bits than a word.
const LEAST_STATE: u32 = 1 << 16;
/// Symbols of an alphabet at most.
const MAX_SYMBOLS: usize = 256;
/// Tables that are in use at once.
pub(super) const MAX_TABLES: usize = 16;
/// A count's class at most.
const MAX_CLASS: u64 = 64;

/// One way of the codec: the model of a page says what there is, a coder writes it or reads it.
pub(in crate::codec) trait Coder {
    /// Whether what it is given is written; otherwise it is ignored, and what was read is returned.
    const WRITES: bool;

    /// Begins a part with tables 0 to `count` of its own.
    fn tables(&mut self, count: usize) -> Result<(), &'static str>;

    /// A symbol below [`MAX_SYMBOLS`] by a table.
    fn symbol(&mut self, table: usize, symbol: u32) -> u32;

    /// A number of so many bits, at most 57.
    fn bits(&mut self, count: u32, value: u64) -> u64;

    /// Ends the part that a kind of field takes.
    fn mark(&mut self);

    /// A number: its magnitude and two bits below the highest one are a symbol, the rest plain bits.
    #[inline]
    fn value(&mut self, table: usize, value: u64) -> u64 {
        let symbol = if !Self::WRITES {
            0
        } else if value < 8 {
            value as u32
        } else {
            let exponent = 63 - value.leading_zeros();
            8 + (exponent - 3) * 4 + (value >> (exponent - 2) & 3) as u32
        };
        let symbol = self.symbol(table, symbol);
        if symbol < 8 {
            return symbol.into();
        }
        // Five more than there are magnitudes fit a symbol of eight bits.
        let count = (symbol - 8 >> 2).min(55) + 1;
        let high = u64::from(4 | (symbol & 3)) << count;
        high | self.bits(count, value & ((1 << count) - 1))
    }
}

/// The numbers that a class of counts stands for: 0, 1, then two to each power of two.
fn class_weight(class: u64) -> u64 {
    if class < 2 { class } else { (2 + (class & 1)) << ((class >> 1) - 1) }
}

/// The class that a count is nearest to, by their ratio.
fn class_of(count: u64) -> u64 {
    if count < 4 {
        return count;
    }
    let exponent = u64::from(63 - count.leading_zeros());
    let class = 2 * exponent + (count >> (exponent - 1) & 1);
    let up = count * count >= class_weight(class) * class_weight(class + 1);
    class + u64::from(up)
}

/// Frequencies of symbols that add up to [`FREQUENCIES`], in the ratio of the weights as far as possible, none of them lost.
fn frequencies(weights: &[u64], into: &mut [u32]) -> Result<(), &'static str> {
    let total: u64 = weights.iter().sum();
    if total == 0 {
        // Nothing comes of it, and so anything goes.
        if let Some(first) = into.first_mut() {
            *first = FREQUENCIES;
        }
        return Ok(());
    }
    let mut left = i64::from(FREQUENCIES);
    for (frequency, &weight) in into.iter_mut().zip(weights) {
        let share = (weight << FREQUENCY_BITS) / total;
        *frequency = if weight > 0 { share.max(1) as u32 } else { 0 };
        left -= i64::from(*frequency);
    }
    // The first one of the most frequent.
    let largest = |into: &[u32]| {
        let mut largest = 0;
        for (symbol, &frequency) in into.iter().enumerate() {
            if frequency > into[largest] {
                largest = symbol;
            }
        }
        largest
    };
    while left < 0 {
        let symbol = largest(into);
        into[symbol] -= 1;
        left += 1;
    }
    let symbol = largest(into);
    into[symbol] += left as u32;
    Ok(())
}

#[derive(Clone)]
struct Table {
    /// For every remainder of a state: symbol, frequency, and the remainder less that of the symbol's first one.
    entries: Box<[u32; FREQUENCIES as usize]>,
}

/// Reads a page.
pub(in crate::codec) struct Reader<'a> {
    words: &'a [u8],
    states: [u32; 2],
    bits: &'a [u8],
    /// Bits taken from the stream and not used yet.
    held: u64,
    num_held: u32,
    /// Whether more was read than there is.
    overrun: bool,
    tables: Tables,
    marks: Vec<usize>,
    start: usize,
}

/// Memory for tables, to be used again.
pub(in crate::codec) struct Tables {
    tables: Vec<Table>,
}

impl Tables {
    pub fn new() -> Self {
        let entries = Box::new([0; FREQUENCIES as usize]);
        Self { tables: vec![Table { entries }; MAX_TABLES] }
    }
}

impl<'a> Reader<'a> {
    /// A reader of the parts that a page begins with.
    pub fn new(cursor: &mut Cursor<'a>, tables: Tables) -> Result<Self, Defect> {
        let num_words = cursor.length("symbols")?;
        let states = cursor.take(8, "symbols")?;
        let words = cursor.take(num_words.saturating_mul(2), "symbols")?;
        let num_bytes = cursor.length("bits")?;
        let bits = cursor.take(num_bytes, "bits")?;
        let state = |at: usize| {
            states[at..].first_chunk().map_or(0, |&bytes: &[u8; 4]| u32::from_le_bytes(bytes))
        };
        Ok(Self {
            start: words.len() + bits.len(),
            words,
            states: [state(0), state(4)],
            bits,
            held: 0,
            num_held: 0,
            overrun: false,
            tables,
            marks: Vec::new(),
        })
    }

    /// That all was read, and nothing more.
    pub fn finish(self) -> Result<(Vec<usize>, Tables), &'static str> {
        if self.overrun {
            return Err("has fewer symbols or bits than nodes need");
        }
        if !self.words.is_empty() || self.states != [LEAST_STATE; 2] {
            return Err("has symbols that lead nowhere");
        }
        if self.held != 0 || self.bits.iter().any(|&byte| byte != 0) {
            return Err("has bits too many");
        }
        Ok((self.marks, self.tables))
    }

    #[inline]
    fn refill(&mut self) {
        if let Some(next) = self.bits.first_chunk::<8>() {
            let taken = (63 - self.num_held) / 8;
            let next = u64::from_le_bytes(*next) & (u64::MAX >> (64 - 8 * taken));
            self.held |= next << self.num_held;
            self.num_held += 8 * taken;
            self.bits = &self.bits[taken as usize..];
        } else {
            while self.num_held <= 56 {
                let Some((&next, rest)) = self.bits.split_first() else { break };
                self.held |= u64::from(next) << self.num_held;
                self.num_held += 8;
                self.bits = rest;
            }
        }
    }

    fn gamma(&mut self) -> u64 {
        let mut length = 0;
        while self.bits(1, 0) == 0 {
            length += 1;
            if length > 20 {
                self.overrun = true;
                return 1;
            }
        }
        1 << length | self.bits(length, 0)
    }

    fn table(&mut self, number: usize) -> Result<(), &'static str> {
        let mut weights = [0; MAX_SYMBOLS];
        let mut frequencies_of = [0; MAX_SYMBOLS];
        let count = (self.gamma() - 1) as usize;
        if count > MAX_SYMBOLS {
            return Err("has a table of too many symbols");
        }
        let mut class = 0i64;
        for weight in &mut weights[..count] {
            class += crate::column::unzigzag(self.gamma() - 1);
            if !(0..=MAX_CLASS as i64).contains(&class) {
                return Err("has a table with a frequency that cannot be");
            }
            *weight = class_weight(class as u64);
        }
        frequencies(&weights[..count.max(1)], &mut frequencies_of[..count.max(1)])?;
        let entries = &mut self.tables.tables[number].entries;
        let mut at = 0;
        for (symbol, &frequency) in (0..).zip(&frequencies_of[..count.max(1)]) {
            let end = at + frequency as usize;
            let entry = symbol | frequency << 8;
            for (offset, into) in (0..).zip(&mut entries[at..end]) {
                *into = entry | offset << 20;
            }
            at = end;
        }
        Ok(())
    }
}

impl Coder for Reader<'_> {
    const WRITES: bool = false;

    fn tables(&mut self, count: usize) -> Result<(), &'static str> {
        (0..count).try_for_each(|number| self.table(number))
    }

    #[inline]
    fn symbol(&mut self, table: usize, _: u32) -> u32 {
        let [state, other] = self.states;
        let entries = &self.tables.tables[table].entries;
        let entry = entries[(state % FREQUENCIES) as usize];
        let frequency = entry >> 8 & 0xfff;
        let mut state = frequency.wrapping_mul(state >> FREQUENCY_BITS).wrapping_add(entry >> 20);
        if state < LEAST_STATE {
            if let Some((&word, rest)) = self.words.split_first_chunk::<2>() {
                state = state << 16 | u32::from(u16::from_le_bytes(word));
                self.words = rest;
            } else {
                self.overrun = true;
            }
        }
        self.states = [other, state];
        entry & 0xff
    }

    #[inline]
    fn bits(&mut self, count: u32, _: u64) -> u64 {
        if self.num_held < count {
            self.refill();
            if self.num_held < count {
                self.overrun = true;
                return 0;
            }
        }
        let value = self.held & ((1 << count) - 1);
        self.held >>= count;
        self.num_held -= count;
        value
    }

    fn mark(&mut self) {
        let rest = self.words.len() + self.bits.len() + self.num_held as usize / 8;
        self.marks.push(self.start - rest);
    }
}

/// Writes a page, after its model has said all there is.
pub(in crate::codec) struct Writer {
    /// Tables and symbols; tables are numbered through the page.
    symbols: Vec<(u16, u8)>,
    counts: Vec<[u32; MAX_SYMBOLS]>,
    first_table: usize,
    bits: Vec<Bits>,
    /// Symbols and bits at each mark.
    marks: Vec<(usize, usize)>,
}

enum Bits {
    Plain { count: u32, value: u64 },
    Tables { first: usize, count: usize },
}

impl Writer {
    pub fn new() -> Self {
        Self {
            symbols: Vec::new(),
            counts: Vec::new(),
            first_table: 0,
            bits: Vec::new(),
            marks: Vec::new(),
        }
    }

    pub fn restart(&mut self) {
        self.symbols.clear();
        self.counts.clear();
        self.bits.clear();
        self.marks.clear();
        self.first_table = 0;
    }

    /// Appends the page, at least so many bytes of it, and returns at which bytes of it the marks are.
    pub fn finish(&self, least_bytes: usize, out: &mut Vec<u8>) -> Vec<usize> {
        let mut frequencies_of = vec![[0u32; MAX_SYMBOLS]; self.counts.len()];
        let mut stream = BitStream::default();
        let mut bit_marks = Vec::with_capacity(self.marks.len());
        let mut marks = self.marks.iter().map(|&(_, bits)| bits).peekable();
        for at in 0..=self.bits.len() {
            while marks.next_if_eq(&at).is_some() {
                bit_marks.push(stream.len());
            }
            match self.bits.get(at) {
                Some(&Bits::Plain { count, value }) => stream.push(count, value),
                Some(&Bits::Tables { first, count }) => {
                    for table in first..first + count {
                        stream.table(&self.counts[table], &mut frequencies_of[table]);
                    }
                }
                None => {}
            }
        }
        let first_of: Vec<[u32; MAX_SYMBOLS]> = frequencies_of
            .iter()
            .map(|frequencies| {
                let mut next = 0;
                frequencies.map(|frequency| {
                    next += frequency;
                    next - frequency
                })
            })
            .collect();
        let mut states = [LEAST_STATE; 2];
        let mut words = Vec::new();
        // Backwards; so a symbol's word comes before those of the symbols before it.
        let mut word_marks = vec![0; self.marks.len()];
        let mut mark = self.marks.len();
        for (at, &(table, symbol)) in self.symbols.iter().enumerate().rev() {
            while mark > 0 && self.marks[mark - 1].0 > at {
                mark -= 1;
                word_marks[mark] = words.len();
            }
            let frequency = frequencies_of[usize::from(table)][usize::from(symbol)];
            let first = first_of[usize::from(table)][usize::from(symbol)];
            let state = &mut states[at % 2];
            if u64::from(*state) >= u64::from(frequency) << (32 - FREQUENCY_BITS) {
                words.push(*state as u16);
                *state >>= 16;
            }
            *state = (*state / frequency << FREQUENCY_BITS) + *state % frequency + first;
        }
        word_marks[..mark].fill(words.len());
        words.reverse();
        push_varint(out, words.len() as u64);
        out.extend(states.iter().flat_map(|state| state.to_le_bytes()));
        out.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        let bytes = stream.finish();
        let padded = bytes.len().max(least_bytes.saturating_sub(out.len()));
        push_varint(out, padded as u64);
        out.extend_from_slice(&bytes);
        out.resize(out.len() + padded - bytes.len(), 0);
        let words_before = |&after: &usize| 2 * (words.len() - after);
        word_marks.iter().map(words_before).zip(bit_marks).map(|(a, b)| a + b).collect()
    }
}

impl Coder for Writer {
    const WRITES: bool = true;

    fn tables(&mut self, count: usize) -> Result<(), &'static str> {
        self.first_table = self.counts.len();
        self.bits.push(Bits::Tables { first: self.first_table, count });
        self.counts.resize(self.first_table + count, [0; MAX_SYMBOLS]);
        Ok(())
    }

    fn symbol(&mut self, table: usize, symbol: u32) -> u32 {
        let table = self.first_table + table;
        self.counts[table][symbol as usize] += 1;
        self.symbols.push((table as u16, symbol as u8));
        symbol
    }

    fn bits(&mut self, count: u32, value: u64) -> u64 {
        self.bits.push(Bits::Plain { count, value });
        value
    }

    fn mark(&mut self) {
        self.marks.push((self.symbols.len(), self.bits.len()));
    }
}

/// Bits in bytes, the lowest first.
#[derive(Default)]
struct BitStream {
    bytes: Vec<u8>,
    held: u64,
    num_held: u32,
}

impl BitStream {
    fn push(&mut self, count: u32, value: u64) {
        self.held |= value << self.num_held;
        self.num_held += count;
        while self.num_held >= 8 {
            self.bytes.push(self.held as u8);
            self.held >>= 8;
            self.num_held -= 8;
        }
    }

    /// Whole bytes that a reader has taken after what was pushed.
    fn len(&self) -> usize {
        self.bytes.len() + usize::from(self.num_held > 0)
    }

    fn gamma(&mut self, value: u64) {
        let length = 63 - value.leading_zeros();
        self.push(length, 0);
        self.push(1, 1);
        self.push(length, value & ((1 << length) - 1));
    }

    fn table(&mut self, counts: &[u32; MAX_SYMBOLS], into: &mut [u32; MAX_SYMBOLS]) {
        let count = counts.iter().rposition(|&count| count > 0).map_or(0, |last| last + 1);
        self.gamma(count as u64 + 1);
        let mut weights = [0; MAX_SYMBOLS];
        let mut last = 0;
        for (weight, &count) in weights.iter_mut().zip(&counts[..count]) {
            let class = class_of(count.into());
            self.gamma(1 + crate::column::zigzag(class as i64 - last));
            last = class as i64;
            *weight = class_weight(class);
        }
        // Fails for no table that is written.
        frequencies(&weights[..count.max(1)], &mut into[..count.max(1)]).ok();
    }

    fn finish(mut self) -> Vec<u8> {
        if self.num_held > 0 {
            self.bytes.push(self.held as u8);
        }
        self.bytes
    }
}

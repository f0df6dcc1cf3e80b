//! Entropy coding of a page: symbols by range asymmetric numeral systems with tables that the page has, and plain bits.
//!
//! # Sources
//! Duda, *Asymmetric numeral systems: entropy coding combining speed of Huffman coding with compression rate of arithmetic
//! coding*, 2013; Giesen, *Interleaved entropy coders*, 2014.

use crate::column::{Cursor, push_varint, unzigzag, zigzag};
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
const MAX_CLASS: i64 = 33;

/// One way of the codec: the model of a page says what there is, a coder writes it or reads it.
pub(in crate::codec) trait Coder {
    /// Whether what it is given is written; otherwise it is ignored, and what was read is returned.
    const WRITES: bool;

    /// What takes symbols of a part.
    type Symbols<'a>: Symbols
    where
        Self: 'a;

    /// Begins a part with tables 0 to `count` of its own.
    fn tables(&mut self, count: usize) -> Result<(), &'static str>;

    /// What takes the symbols; they are taken for good when it is [ended](Symbols::end).
    fn symbols(&mut self) -> Self::Symbols<'_>;

    /// Ends the part that a kind of field takes.
    fn mark(&mut self);
}

/// Takes symbols and bits. A value of its own and not behind a reference, so that a reader's is all in registers.
pub(in crate::codec) trait Symbols: Sized {
    /// As that of the coder.
    const WRITES: bool;

    /// A symbol below [`MAX_SYMBOLS`] by a table.
    fn symbol(&mut self, table: usize, symbol: u32) -> u32;

    /// A number of so many bits, at most 56.
    fn bits(&mut self, count: u32, value: u64) -> u64;

    /// Hands back to the coder.
    fn end(self);

    /// A number: its magnitude and two bits below the highest one are a symbol, the rest plain bits.
    #[inline(always)]
    fn value(&mut self, table: usize, value: u64) -> u64 {
        let mut symbol = 0;
        if Self::WRITES {
            symbol = value as u32;
            if value >= 8 {
                let exponent = 63 - value.leading_zeros();
                symbol = 8 + (exponent - 3) * 4 + (value >> (exponent - 2) & 3) as u32;
            }
        }
        let symbol = self.symbol(table, symbol);
        // Five more magnitudes than there are fit a symbol of eight bits. No branches: they would be taken at random.
        let is_small = symbol < 8;
        let count = if is_small { 0 } else { (symbol.wrapping_sub(8) >> 2).min(55) + 1 };
        let high = if is_small { symbol } else { 4 | (symbol & 3) };
        u64::from(high) << count | self.bits(count, value & ((1 << count) - 1))
    }

    /// A number of either sign: 0, −1, 1, −2, 2, … are 0, 1, 2, 3, 4, ….
    #[inline(always)]
    fn signed(&mut self, table: usize, value: i64) -> i64 {
        let value = if Self::WRITES { zigzag(value) } else { 0 };
        unzigzag(self.value(table, value))
    }
}

/// The numbers that a class of counts stands for: 0, 1, then two to each power of two.
fn class_weight(class: u32) -> u32 {
    if class < 2 { class } else { (2 + (class & 1)) << ((class >> 1) - 1) }
}

/// The class that a count is nearest to, by their ratio.
fn class_of(count: u32) -> u32 {
    if count < 4 {
        return count;
    }
    let exponent = 31 - count.leading_zeros();
    let class = 2 * exponent + (count >> (exponent - 1) & 1);
    let between = u64::from(class_weight(class)) * u64::from(class_weight(class + 1));
    (class + u32::from(u64::from(count) * u64::from(count) >= between)).min(MAX_CLASS as u32)
}

/// Frequencies of symbols that add up to [`FREQUENCIES`], in the ratio of the weights as far as possible, none of them lost.
/// There is a weight at least.
fn frequencies(weights: &[u32], into: &mut [u32]) {
    let total: u32 = weights.iter().sum();
    if total == 0 {
        // Nothing comes of it, and so anything goes.
        into.fill(0);
        into[0] = FREQUENCIES;
        return;
    }
    let mut left = FREQUENCIES as i32;
    let mut largest = 0;
    for (symbol, &weight) in weights.iter().enumerate() {
        let least = u32::from(weight > 0);
        let frequency = ((weight << FREQUENCY_BITS) / total).max(least);
        into[symbol] = frequency;
        left -= frequency as i32;
        if frequency > into[largest] {
            largest = symbol;
        }
    }
    while left < 0 {
        // The first one of the most frequent.
        let most = into.iter().copied().max().unwrap_or(0);
        largest = into.iter().position(|&frequency| frequency == most).unwrap_or(0);
        into[largest] -= 1;
        left += 1;
    }
    into[largest] += left as u32;
}

#[derive(Clone)]
struct Table {
    /// For every remainder of a state: symbol, frequency, and the remainder less that of the symbol's first one.
    entries: Box<[u32; FREQUENCIES as usize]>,
}

/// Memory for tables, to be used again.
pub(in crate::codec) struct Tables {
    tables: Vec<Table>,
    weights: [u32; MAX_SYMBOLS],
    frequencies: [u32; MAX_SYMBOLS],
}

impl Tables {
    pub fn new() -> Self {
        let entries = Box::new([0; FREQUENCIES as usize]);
        Self {
            tables: vec![Table { entries }; MAX_TABLES],
            weights: [0; MAX_SYMBOLS],
            frequencies: [0; MAX_SYMBOLS],
        }
    }
}

/// Where a reader is. Beyond the end all is zero, and it goes on: in the end it is seen that it went too far.
#[derive(Clone, Copy)]
struct State<'a> {
    words: &'a [u8],
    words_at: usize,
    /// The state of the next symbol and that of the one after it.
    state: u32,
    other: u32,
    bits: &'a [u8],
    bits_at: usize,
}

/// Reads a page.
pub(in crate::codec) struct Reader<'a> {
    state: State<'a>,
    tables: Tables,
    marks: Vec<usize>,
}

/// Reads over symbols and bits of which it is not known what they mean.
pub(in crate::codec) fn skip_symbols(cursor: &mut Cursor<'_>) -> Result<(), Defect> {
    let num_words = cursor.length("symbols")?;
    cursor.take(num_words.saturating_mul(2).saturating_add(8), "symbols")?;
    let num_bytes = cursor.length("bits")?;
    cursor.take(num_bytes, "bits")?;
    Ok(())
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
        let [state, other] = [state(0), state(4)];
        let state = State { words, words_at: 0, state, other, bits, bits_at: 0 };
        Ok(Self { state, tables, marks: Vec::new() })
    }

    /// That all was read, and nothing more.
    pub fn finish(self) -> Result<(Vec<usize>, Tables), &'static str> {
        let State { words, words_at, state, other, bits, bits_at } = self.state;
        if words_at > words.len() || bits_at > 8 * bits.len() {
            return Err("has fewer symbols or bits than nodes need");
        }
        if words_at < words.len() || [state, other] != [LEAST_STATE; 2] {
            return Err("has symbols that lead nowhere");
        }
        let mut rest = bits[bits_at / 8..].iter();
        let used = bits_at % 8;
        if rest.next().is_some_and(|&byte| byte >> used != 0) || rest.any(|&byte| byte != 0) {
            return Err("has bits too many");
        }
        Ok((self.marks, self.tables))
    }

    fn table(&mut self, number: usize) -> Result<(), &'static str> {
        let Tables { tables, weights, frequencies: shares } = &mut self.tables;
        let count = (self.state.gamma() - 1) as usize;
        if count > MAX_SYMBOLS {
            return Err("has a table of too many symbols");
        }
        let weights = &mut weights[..count.max(1)];
        weights[0] = 0;
        let mut class = 0;
        for weight in &mut weights[..count] {
            class += unzigzag(self.state.gamma() - 1);
            if !(0..=MAX_CLASS).contains(&class) {
                return Err("has a table with a frequency that cannot be");
            }
            *weight = class_weight(class as u32);
        }
        let shares = &mut shares[..count.max(1)];
        frequencies(weights, shares);
        let mut rest = &mut tables[number].entries[..];
        for (symbol, &frequency) in (0..).zip(&*shares) {
            let (own, others) = rest.split_at_mut((frequency as usize).min(rest.len()));
            let mut entry = symbol | frequency << 8;
            for into in own {
                *into = entry;
                entry += 1 << 20;
            }
            rest = others;
        }
        Ok(())
    }
}

impl<'a> Coder for Reader<'a> {
    const WRITES: bool = false;

    type Symbols<'s>
        = Reading<'s, 'a>
    where
        Self: 's;

    fn tables(&mut self, count: usize) -> Result<(), &'static str> {
        (0..count).try_for_each(|number| self.table(number))
    }

    #[inline(always)]
    fn symbols(&mut self) -> Reading<'_, 'a> {
        Reading { at: self.state, home: &mut self.state, tables: &self.tables.tables }
    }

    fn mark(&mut self) {
        let State { words_at, bits_at, .. } = self.state;
        self.marks.push(words_at + bits_at.div_ceil(8));
    }
}

/// Reads symbols.
pub(in crate::codec) struct Reading<'s, 'a> {
    at: State<'a>,
    home: &'s mut State<'a>,
    tables: &'s [Table],
}

impl Symbols for Reading<'_, '_> {
    const WRITES: bool = false;

    #[inline(always)]
    fn symbol(&mut self, table: usize, _: u32) -> u32 {
        let at = &mut self.at;
        let state = std::mem::replace(&mut at.state, at.other);
        let entry = self.tables[table].entries[(state % FREQUENCIES) as usize];
        let frequency = entry >> 8 & 0xfff;
        let state = frequency.wrapping_mul(state >> FREQUENCY_BITS).wrapping_add(entry >> 20);
        let word = at.words.get(at.words_at..).and_then(|words| words.first_chunk());
        let word = word.map_or(0, |&word| u16::from_le_bytes(word));
        // Whether a word is due is a matter of chance, so there is no branch for it.
        let is_due = state < LEAST_STATE;
        at.other = if is_due { state << 16 | u32::from(word) } else { state };
        at.words_at += if is_due { 2 } else { 0 };
        entry & 0xff
    }

    #[inline(always)]
    fn bits(&mut self, count: u32, _: u64) -> u64 {
        self.at.take(count)
    }

    #[inline(always)]
    fn end(self) {
        *self.home = self.at;
    }
}

impl State<'_> {
    /// The next bits, 57 of them at least.
    #[inline(always)]
    fn ahead(&self) -> u64 {
        let rest = self.bits.get(self.bits_at / 8..).unwrap_or_default();
        let bytes = match rest.first_chunk() {
            Some(&bytes) => u64::from_le_bytes(bytes),
            None => last_bytes(rest),
        };
        bytes >> (self.bits_at % 8)
    }

    /// A number of so many bits, at most 56.
    #[inline(always)]
    fn take(&mut self, count: u32) -> u64 {
        let value = self.ahead() & ((1 << count) - 1);
        self.bits_at += count as usize;
        value
    }

    /// A number from 1 on, as many zeros as it has bits after its highest one before it.
    #[inline(always)]
    fn gamma(&mut self) -> u64 {
        let ahead = self.ahead();
        // Where there are more zeros than that it went too far, or it is one that cannot be.
        let length = ahead.trailing_zeros().min(24);
        self.bits_at += 2 * length as usize + 1;
        1 << length | (ahead >> (length + 1) & ((1 << length) - 1))
    }
}

/// Fewer than eight bytes.
#[cold]
fn last_bytes(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |all, &byte| all << 8 | u64::from(byte))
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
                    let tables = first..first + count;
                    let frequencies = &mut frequencies_of[tables.clone()];
                    for (counts, into) in self.counts[tables].iter().zip(frequencies) {
                        stream.table(counts, into);
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
            *state = ((*state / frequency) << FREQUENCY_BITS) + *state % frequency + first;
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

    type Symbols<'s> = &'s mut Self;

    fn tables(&mut self, count: usize) -> Result<(), &'static str> {
        self.first_table = self.counts.len();
        self.bits.push(Bits::Tables { first: self.first_table, count });
        self.counts.resize(self.first_table + count, [0; MAX_SYMBOLS]);
        Ok(())
    }

    fn symbols(&mut self) -> &mut Self {
        self
    }

    fn mark(&mut self) {
        self.marks.push((self.symbols.len(), self.bits.len()));
    }
}

impl Symbols for &mut Writer {
    const WRITES: bool = true;

    fn symbol(&mut self, table: usize, symbol: u32) -> u32 {
        let table = self.first_table + table;
        self.counts[table][symbol as usize] += 1;
        self.symbols.push((table as u16, symbol as u8));
        symbol
    }

    fn bits(&mut self, count: u32, value: u64) -> u64 {
        if count > 0 {
            self.bits.push(Bits::Plain { count, value });
        }
        value
    }

    fn end(self) {}
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
            let class = class_of(count);
            self.gamma(1 + zigzag(i64::from(class) - last));
            last = class.into();
            *weight = class_weight(class);
        }
        frequencies(&weights[..count.max(1)], &mut into[..count.max(1)]);
    }

    fn finish(mut self) -> Vec<u8> {
        if self.num_held > 0 {
            self.bytes.push(self.held as u8);
        }
        self.bytes
    }
}

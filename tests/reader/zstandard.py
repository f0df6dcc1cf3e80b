"""Frames of Zstandard (RFC 8878), unpacked slowly: as much of it as .xfm files need, which have no dictionaries."""

LITERAL_LENGTHS = (
    [(n, 0) for n in range(16)]
    + [(16, 1), (18, 1), (20, 1), (22, 1), (24, 2), (28, 2), (32, 3), (40, 3), (48, 4), (64, 6)]
    + [(1 << n, n) for n in range(7, 17)]
)
MATCH_LENGTHS = (
    [(n + 3, 0) for n in range(32)]
    + [(35, 1), (37, 1), (39, 1), (41, 1), (43, 2), (47, 2), (51, 3), (59, 3), (67, 4), (83, 4)]
    + [(99, 5), (131, 7)]
    + [((1 << n) + 3, n) for n in range(8, 17)]
)
LITERAL_LENGTH_COUNTS = [4, 3] + [2] * 6 + [2, 2, 2, 2, 2, 1, 1, 1] + [2] * 9 + [3, 2, 1, 1, 1, 1, 1]
LITERAL_LENGTH_COUNTS += [-1] * 4
MATCH_LENGTH_COUNTS = [1, 4, 3, 2, 2, 2, 2, 2, 2] + [1] * 37 + [-1] * 7
OFFSET_COUNTS = [1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1] + [1] * 12 + [-1] * 5


class Forwards:
    """Bits from the first byte on, the lowest first."""

    def __init__(self, data):
        self.bits = int.from_bytes(data, "little")
        self.at = 0

    def peek(self, count):
        return self.bits >> self.at & ((1 << count) - 1)

    def take(self, count):
        value = self.peek(count)
        self.at += count
        return value


class Backwards:
    """Bits from the last byte on, the highest first, after the mark that is the highest one; zeros in the end."""

    def __init__(self, data):
        self.bits = int.from_bytes(data, "little")
        self.left = self.bits.bit_length() - 1

    def take(self, count):
        self.left -= count
        if self.left >= 0:
            return self.bits >> self.left & ((1 << count) - 1)
        return self.bits << -self.left & ((1 << count) - 1)


def read_counts(data, most_log):
    """A table's log, its counts, and how many bytes they took."""
    bits = Forwards(data)
    log = bits.take(4) + 5
    assert log <= most_log
    left, counts = (1 << log) + 1, []
    while left > 1:
        length = left.bit_length()
        value = bits.peek(length)
        few = (1 << length) - 1 - left
        low = value & ((1 << (length - 1)) - 1)
        if low < few:
            bits.at += length - 1
            value = low
        else:
            bits.at += length
            if value >= 1 << (length - 1):
                value -= few
        count = value - 1
        left -= abs(count)
        counts.append(count)
        if count == 0:
            while True:
                zeros = bits.take(2)
                counts += [0] * zeros
                if zeros < 3:
                    break
    return log, counts, (bits.at + 7) // 8


def fse_table(log, counts):
    """Per state: symbol, number of bits, base of the next state."""
    size = 1 << log
    symbols, high = [0] * size, size
    for symbol, count in enumerate(counts):
        if count == -1:
            high -= 1
            symbols[high] = symbol
    at = 0
    for symbol, count in enumerate(counts):
        for _ in range(max(count, 0)):
            symbols[at] = symbol
            while True:
                at = at + (size >> 1) + (size >> 3) + 3 & size - 1
                if at < high:
                    break
    following = [1 if count == -1 else count for count in counts]
    table = []
    for symbol in symbols:
        state = following[symbol]
        following[symbol] += 1
        bits = log - (state.bit_length() - 1)
        table.append((symbol, bits, (state << bits) - size))
    return table


def read_weights(data):
    """The Huffman table of a block, as (symbol, bits) by the next bits, its log, and how many bytes it took."""
    head = data[0]
    if head >= 128:
        count = head - 127
        weights = [data[1 + i // 2] >> (0 if i % 2 else 4) & 15 for i in range(count)]
        length = 1 + (count + 1) // 2
    else:
        length = 1 + head
        log, counts, used = read_counts(data[1:length], 6)
        table = fse_table(log, counts)
        bits = Backwards(data[1 + used : length])
        states = [bits.take(log), bits.take(log)]
        weights = []
        while True:
            symbol, count, base = table[states[0]]
            weights.append(symbol)
            if bits.left < count:
                weights.append(table[states[1]][0])
                break
            states = [states[1], base + bits.take(count)]
    total = sum(1 << w - 1 for w in weights if w)
    log = total.bit_length()
    weights.append(((1 << log) - total).bit_length())
    table = []
    for weight in range(1, log + 1):
        for symbol, own in enumerate(weights):
            if own == weight:
                table += [(symbol, log + 1 - weight)] * (1 << weight - 1)
    return (table, log), length


def huffman(data, count, table):
    entries, log = table
    bits = Backwards(data)
    out = bytearray()
    state = bits.take(log)
    for _ in range(count):
        symbol, used = entries[state]
        out.append(symbol)
        state = (state << used | bits.take(used)) & (1 << log) - 1
    return out


class Frame:
    """What blocks of a frame leave to those after them."""

    def __init__(self):
        self.out = bytearray()
        self.huffman = None
        self.tables = [None, None, None]
        self.offsets = [1, 4, 8]

    def literals(self, data):
        kind, form = data[0] & 3, data[0] >> 2 & 3
        if kind < 2:
            head = 1 if form in (0, 2) else form // 2 + 2
            size = int.from_bytes(data[:head], "little") >> (3 if head == 1 else 4)
            if kind == 0:
                return data[head : head + size], head + size
            return data[head : head + 1] * size, head + 1
        head, width = [(3, 10), (3, 10), (4, 14), (5, 18)][form]
        number = int.from_bytes(data[:head], "little") >> 4
        size, packed = number & (1 << width) - 1, number >> width
        end = head + packed
        if kind == 2:
            self.huffman, used = read_weights(data[head:])
            head += used
        if form == 0:
            return huffman(data[head:end], size, self.huffman), end
        sizes = [int.from_bytes(data[head + 2 * i : head + 2 * i + 2], "little") for i in range(3)]
        head += 6
        out = bytearray()
        for i in range(4):
            stop = head + sizes[i] if i < 3 else end
            part = (size + 3) // 4
            out += huffman(data[head:stop], part if i < 3 else size - 3 * part, self.huffman)
            head = stop
        return out, end

    def block(self, data):
        literals, at = self.literals(data)
        count = data[at]
        at += 1
        if count >= 128:
            if count < 255:
                count = (count - 128 << 8) + data[at]
                at += 1
            else:
                count = data[at] + (data[at + 1] << 8) + 0x7F00
                at += 2
        if count == 0:
            self.out += literals
            return
        modes = data[at]
        at += 1
        known = [(6, LITERAL_LENGTH_COUNTS), (5, OFFSET_COUNTS), (6, MATCH_LENGTH_COUNTS)]
        for i, most in enumerate([9, 8, 9]):
            mode = modes >> 6 - 2 * i & 3
            if mode == 0:
                self.tables[i] = (known[i][0], fse_table(*known[i]))
            elif mode == 1:
                self.tables[i] = (0, [(data[at], 0, 0)])
                at += 1
            elif mode == 2:
                log, counts, used = read_counts(data[at:], most)
                self.tables[i] = (log, fse_table(log, counts))
                at += used
        bits = Backwards(data[at:])
        states = [bits.take(log) for log, _ in self.tables]
        used = 0
        for sequence in range(count):
            entries = [table[state] for (_, table), state in zip(self.tables, states)]
            code = entries[1][0]
            offset = (1 << code) + bits.take(code)
            base, extra = MATCH_LENGTHS[entries[2][0]]
            match = base + bits.take(extra)
            base, extra = LITERAL_LENGTHS[entries[0][0]]
            length = base + bits.take(extra)
            if sequence + 1 < count:
                for i in (0, 2, 1):
                    states[i] = entries[i][2] + bits.take(entries[i][1])
            self.out += literals[used : used + length]
            used += length
            self.copy(self.offset(offset, length), match)
        self.out += literals[used:]

    def offset(self, value, length):
        recent = self.offsets
        if value > 3:
            self.offsets = [value - 3] + recent[:2]
            return self.offsets[0]
        which = value - 1 + (length == 0)
        if which == 3:
            found = recent[0] - 1
            self.offsets = [found] + recent[:2]
        else:
            found = recent[which]
            self.offsets = [found] + recent[:which] + recent[which + 1 :]
        return found

    def copy(self, offset, length):
        for _ in range(length):
            self.out.append(self.out[-offset])


def unpack(data):
    """What a frame without its magic number holds."""
    head = data[0]
    single = head >> 5 & 1
    at = 1 + (0 if single else 1) + [0, 1, 2, 4][head & 3]
    at += [1 if single else 0, 2, 4, 8][head >> 6]
    frame = Frame()
    while True:
        block = int.from_bytes(data[at : at + 3], "little")
        last, kind, size = block & 1, block >> 1 & 3, block >> 3
        at += 3
        if kind == 0:
            frame.out += data[at : at + size]
        elif kind == 1:
            frame.out += data[at : at + 1] * size
            size = 1
        else:
            frame.block(data[at : at + size])
        at += size
        if last:
            return bytes(frame.out)

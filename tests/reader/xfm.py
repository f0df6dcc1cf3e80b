"""A second reader of .xfm files, written from FORMAT.md alone: all of the mesh, slowly.

    python xfm.py FILE.xfm OUT

OUT gets the numbers of vertices and triangles (u64 each), the vertices (three f32 each) and the triangles (three u32 each), and
where there are any, the colours of the vertices (four u8 each).
"""

import math
import struct
import sys
import zlib

import numpy as np

import zstandard

NONE = None


def zigzag(value):
    return value // 2 if value % 2 == 0 else -(value + 1) // 2


class Bytes:
    """Bytes taken one after another."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        assert self.at + count <= len(self.data), "cut short"
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, form):
        return struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))[0]

    def varint(self):
        value = 0
        for shift in range(0, 63, 7):
            byte = self.take(1)[0]
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise ValueError("a varint of more than nine bytes")

    def column(self, count):
        """Section 3."""
        values = np.zeros(count, np.uint64)
        for plane in range(self.take(1)[0]):
            method = self.take(1)[0]
            if method == 0:
                content = self.take(1) * count
            elif method == 1:
                content = self.take(count)
            else:
                assert method == 2, "an unknown method"
                content = zstandard.unpack(self.take(self.varint()))
            assert len(content) == count
            plane = np.uint64(8 * plane)
            values |= np.frombuffer(content, np.uint8).astype(np.uint64) << plane
        return [int(value) for value in values]

    def end(self):
        assert self.at == len(self.data), "bytes too many"


def float_from(difference, predicted):
    bits = struct.unpack("<I", struct.pack("<f", predicted))[0]
    key = bits ^ 0xFFFFFFFF if bits >> 31 else bits | 1 << 31
    key = key + zigzag(difference) & 0xFFFFFFFF
    bits = key & 0x7FFFFFFF if key >> 31 else key ^ 0xFFFFFFFF
    return struct.unpack("<f", struct.pack("<I", bits))[0]


def short_from(difference, predicted):
    return (predicted + zigzag(difference) + 0x8000 & 0xFFFF) - 0x8000


def colour_from(difference, near):
    red, green, blue, alpha = difference
    return tuple((n + d) % 256 for n, d in zip(near, (red + green, green, blue + green, alpha)))


def f32(value):
    return float(np.float32(value))


class Node:
    """A node, and what the coding of pages needs to know of it."""

    def __init__(self, id):
        self.id = id
        self.left = self.right = self.parent = self.above = NONE
        self.is_left = False
        self.kinds = (0, 0)
        self.adjacent = [NONE] * 4


class Header:
    """Section 2."""

    def __init__(self, data):
        assert data[:8] == b"XFM\x8f\r\n\x1a\n", "not an .xfm file"
        assert struct.unpack_from("<I", data, 8)[0] == 2, "an unknown version"
        length = struct.unpack_from("<I", data, 12)[0]
        assert zlib.crc32(data[: length - 4]) == struct.unpack_from("<I", data, length - 4)[0]
        assert struct.unpack_from("<Q", data, 16)[0] & 0xFFFFFFFF == 0, "unknown features"
        self.encoding, self.levels, attributes = struct.unpack_from("<BBH", data, 24)
        assert self.encoding in (0, 1), "an unknown encoding"
        counts = struct.unpack_from("<8Q", data, 32)
        self.triangles, self.nodes, self.blocks, self.pages = counts[:4]
        self.base_vertices, self.base_faces, self.roots, _ = counts[4:]
        self.sections = [struct.unpack_from("<QQI", data, at) for at in (120, 144, 168, 192)]
        assert struct.unpack_from("<Q", data, 216)[0] == len(data)
        table = [data[at : at + 32] for at in range(256, 256 + 32 * attributes, 32)]
        # Components and coding of further attributes; the first one that is as a colour's must be is taken.
        self.more = [(entry[29], entry[30]) for entry in table[5:]]
        assert all(entry[30] < 2 and entry[31] == 0 for entry in table)
        colour = b"colour".ljust(16, b"\0") + b"1/255".ljust(12, b"\0")
        colour += bytes([3, 4, self.encoding, 0])
        self.colour = table.index(colour, 5) - 5 if colour in table[5:] else NONE
        if self.encoding == 1:
            self.step, self.error = struct.unpack_from("<dd", data, 256 + 32 * attributes)

    def section(self, data, number, tag):
        offset, length, checksum = self.sections[number]
        content = data[offset : offset + length]
        assert zlib.crc32(tag + content) == checksum, "a wrong checksum"
        return content


class File:
    """All of a file."""

    def __init__(self, data):
        self.header = header = Header(data)
        self.read_base(Bytes(header.section(data, 0, b"B")))
        roots = Bytes(header.section(data, 1, b"R"))
        steps, blocks = roots.column(header.roots), roots.column(header.roots)
        roots.end()
        vertex = block = 0
        self.roots = {}
        for step, code in zip(steps, blocks):
            vertex, block = vertex + step, block + zigzag(code)
            self.roots[block << header.levels] = vertex
        self.nodes = {}
        index = header.section(data, 3, b"I")
        for page in range(header.pages):
            entry = struct.unpack_from("<QQIIII", index, 32 * page)
            first_block, offset, length, blocks, nodes, checksum = entry
            content = data[offset : offset + length]
            assert zlib.crc32(b"P" + struct.pack("<Q", page) + content) == checksum
            self.read_page(content, first_block, blocks, nodes)
        assert len(self.nodes) == header.nodes

    def read_base(self, data):
        vertices, faces = self.header.base_vertices, self.header.base_faces
        self.positions = [[0.0] * 3 for _ in range(vertices)]
        for axis in range(3):
            last = 0.0
            for vertex, code in enumerate(data.column(vertices)):
                last = self.positions[vertex][axis] = float_from(code, last)
        for _ in range(2):
            data.column(vertices)
        first, second, third = (data.column(faces) for _ in range(3))
        self.colours = [(0, 0, 0, 0)] * vertices
        for number, (components, _) in enumerate(self.header.more):
            columns = [data.column(vertices) for _ in range(components)]
            if number == self.header.colour:
                last = (0, 0, 0, 0)
                for vertex, codes in enumerate(zip(*columns)):
                    last = self.colours[vertex] = colour_from(map(zigzag, codes), last)
        data.end()
        self.faces, last = [], 0
        for a, b, c in zip(first, second, third):
            last += zigzag(a)
            self.faces.append([last, last + zigzag(b), last + zigzag(c)])

    def read_page(self, content, first_block, num_blocks, num_nodes):
        data = Bytes(content)
        page = Page(self.header, first_block, num_blocks)
        if self.header.encoding == 0:
            page.shapes(data.column(num_nodes))
            page.links(data.column)
            self.exact(data, page)
        else:
            coder = Coder(data)
            coder.tables(2)
            last, shapes = 0, []
            for _ in range(num_nodes):
                last = coder.symbol(int(last % 4 == 1 or last // 4 == 1))
                shapes.append(last)
            page.shapes(shapes)
            coder.tables(3)
            tables = iter(range(3))

            def values(count):
                table = next(tables)
                return [coder.value(table) for _ in range(count)]

            page.links(values)
            Compact(self.header, page, coder).read()
            coder.end()
        for number, (components, coding) in enumerate(self.header.more):
            if number == self.header.colour:
                self.page_colours(data, page)
            elif coding == 0:
                for _ in range(components):
                    data.column(num_nodes)
            else:
                data.take(2 * data.varint() + 8)
                data.take(data.varint())
        data.end()
        for node in page.nodes:
            assert node.id not in self.nodes
            self.nodes[node.id] = node

    def page_colours(self, data, page):
        """Section 6."""
        nodes, black = page.nodes, (0, 0, 0, 0)
        if self.header.encoding == 0:
            columns = [data.column(len(nodes)) for _ in range(4)]
            for node, codes in zip(nodes, zip(*columns)):
                near = black if node.reference is node else node.reference.colour
                node.colour = colour_from(map(zigzag, codes), near)
            return
        coder = Coder(data)
        coder.tables(9)
        for node in nodes:
            green = coder.signed(node.group)
            others = 4 + sum(abs(green) >= least for least in (2, 8, 24))
            red, blue, alpha = coder.signed(others), coder.signed(others), coder.signed(8)
            assert all(-128 <= c < 128 for c in (red, green, blue, alpha))
            near = black if node.near is node else node.near.colour
            node.colour = colour_from((red, green, blue, alpha), near)
        coder.end()

    def exact(self, data, page):
        """Section 4."""
        nodes, header = page.nodes, self.header
        for node in nodes:
            node.position, node.normal = [0.0] * 3, [0] * 2
        for axis in range(3):
            for node, code in zip(nodes, data.column(len(nodes))):
                near = 0.0 if node.reference is node else node.reference.position[axis]
                node.position[axis] = float_from(code, near)
        for axis in range(2):
            for node, code in zip(nodes, data.column(len(nodes))):
                near = 0 if node.reference is node else node.reference.normal[axis]
                node.normal[axis] = short_from(code, near)
        for _ in range(3):
            data.column(len(nodes))
        for node, code in zip(nodes, data.column(len(nodes))):
            node.order = (header.nodes if node.above is NONE else node.above.order) - code - 1
        for which in range(4):
            for node, code in zip(nodes, data.column(len(nodes))):
                if code:
                    own = 3 * header.base_faces + 6 * node.id
                    node.adjacent[which] = own + zigzag(code - 1)

    def mesh(self):
        """Vertices and triangles after all splits."""
        base = 3 * self.header.base_faces
        start, reverse = {}, {}
        edges = {}
        for face, corners in enumerate(self.faces):
            for i in range(3):
                start[3 * face + i] = corners[i]
                edges[corners[i], corners[(i + 1) % 3]] = 3 * face + i
        for (a, b), h in edges.items():
            reverse[h] = edges.get((b, a))

        def link(a, b):
            if a is not NONE:
                reverse[a] = b
            if b is not NONE:
                reverse[b] = a

        for node in sorted(self.nodes.values(), key=lambda node: -node.order):
            w, x, y, z = node.adjacent
            u = start[x] if x is not NONE else start[after(w)]
            p = start[w] if w is not NONE else start[after(x)]
            v = len(self.positions)
            self.positions.append(node.position)
            if self.header.colour is not NONE:
                self.colours.append(node.colour)
            assert (x is NONE or reverse[x] == w) and (z is NONE or reverse[z] == y)
            fan = x
            while fan is not NONE:
                start[fan] = v
                fan = NONE if before(fan) == y else reverse[before(fan)]
            h = base + 6 * node.id
            start[h], start[h + 1], start[h + 2] = v, u, p
            link(h + 1, w)
            link(h + 2, x)
            reverse[h] = NONE
            if y is not NONE:
                start[h + 3], start[h + 4], start[h + 5] = u, v, start[y]
                link(h, h + 3)
                link(h + 4, y)
                link(h + 5, z)
        firsts = sorted(h for h in start if h % 3 == 0)
        triangles = [[start[h], start[h + 1], start[h + 2]] for h in firsts]
        assert len(triangles) == self.header.triangles
        return np.array(self.positions, np.float32), np.array(triangles, np.uint32)


def after(h):
    return h - 2 if h % 3 == 2 else h + 1


def before(h):
    return h + 2 if h % 3 == 0 else h - 1


class Page:
    """The nodes of a page and how they hang together: shape and links of section 4."""

    def __init__(self, header, first_block, num_blocks):
        self.levels = header.levels
        self.first_block, self.num_blocks = first_block, num_blocks

    def shapes(self, shapes):
        self.nodes, self.blocks = [], []
        waiting, hangs = [], NONE
        for shape in shapes:
            if hangs is NONE:
                self.blocks.append([])
            block = self.first_block + len(self.blocks) - 1
            node = Node((block << self.levels) + len(self.blocks[-1]))
            assert len(self.blocks[-1]) < (1 << self.levels) - 1
            self.blocks[-1].append(node)
            self.nodes.append(node)
            node.kinds = (shape % 4, shape // 4)
            if hangs is not NONE:
                self.hang(node, *hangs)
            left, right = (kind == 1 for kind in node.kinds)
            if left:
                if right:
                    waiting.append(node)
                hangs = (node, True)
            elif right:
                hangs = (node, False)
            else:
                hangs = (waiting.pop(), False) if waiting else NONE
        assert hangs is NONE and len(self.blocks) == self.num_blocks

    def hang(self, node, parent, is_left):
        node.above, node.is_left, node.parent = parent, is_left, parent.id
        if is_left:
            parent.left = node.id
        else:
            parent.right = node.id

    def links(self, column):
        outside = [
            (node, side == 0, kind)
            for node in self.nodes
            for side, kind in enumerate(node.kinds)
            if kind >= 2
        ]
        inside = [(node, is_left) for node, is_left, kind in outside if kind == 2]
        for (parent, is_left), distance in zip(inside, column(len(inside))):
            block = (parent.id >> self.levels) - self.first_block + distance + 1
            first = self.blocks[block][0]
            assert first.above is NONE
            self.hang(first, parent, is_left)
        others = [(node, is_left) for node, is_left, kind in outside if kind == 3]
        expected = self.first_block + self.num_blocks
        for (parent, is_left), code in zip(others, column(len(others))):
            block = expected + zigzag(code)
            expected = block + 1
            if is_left:
                parent.left = block << self.levels
            else:
                parent.right = block << self.levels
        tops = [block[0] for block in self.blocks if block[0].above is NONE]
        last = tops[0]
        for top, distance in zip(tops, column(len(tops))):
            if distance:
                top.parent = (self.first_block << self.levels) - distance
            top.reference, last = last, top
        for node in self.nodes:
            if node.above is not NONE:
                node.reference = node.above


class Coder:
    """Symbols, bits and tables of section 5."""

    def __init__(self, data):
        words = data.varint()
        self.states = [data.number("I"), data.number("I")]
        self.words = np.frombuffer(data.take(2 * words), "<u2").tolist()
        self.next_word = 0
        content = data.take(data.varint())
        self.stream, self.length = int.from_bytes(content, "little"), 8 * len(content)
        self.at = 0

    def bits(self, count):
        self.at += count
        assert self.at <= self.length
        return self.stream >> self.at - count & (1 << count) - 1

    def gamma(self):
        length = 0
        while self.bits(1) == 0:
            length += 1
            assert length <= 24
        return (1 << length) + self.bits(length)

    def tables(self, count):
        self.slots = [self.table() for _ in range(count)]

    def table(self):
        weights, last = [], 0
        for _ in range(self.gamma() - 1):
            last += zigzag(self.gamma() - 1)
            assert 0 <= last <= 33
            weights.append(last if last < 2 else (2 + last % 2) << last // 2 - 1)
        total = sum(weights)
        if total == 0:
            return [(0, 1024, slot) for slot in range(1024)]
        shares = [max(w * 1024 // total, 1) if w else 0 for w in weights]
        while sum(shares) > 1024:
            shares[shares.index(max(shares))] -= 1
        shares[shares.index(max(shares))] += 1024 - sum(shares)
        return [
            (symbol, share, offset)
            for symbol, share in enumerate(shares)
            for offset in range(share)
        ]

    def symbol(self, table):
        state, other = self.states
        symbol, share, offset = self.slots[table][state % 1024]
        state = share * (state // 1024) + offset
        if state < 1 << 16:
            state = state << 16 | self.words[self.next_word]
            self.next_word += 1
        self.states = [other, state]
        return symbol

    def value(self, table):
        symbol = self.symbol(table)
        if symbol < 8:
            return symbol
        count = (symbol - 8) // 4 + 1
        return (4 + symbol % 4 << count) + self.bits(count)

    def signed(self, table):
        return zigzag(self.value(table))

    def end(self):
        assert self.next_word == len(self.words) and self.states == [1 << 16] * 2
        assert self.stream >> self.at == 0


def code_up(value):
    """The least 16-bit float that is not below a number."""
    single = np.float32(value)
    if float(single) < value:
        single = np.nextafter(single, np.float32(np.inf))
    return int(single.view(np.uint32)) + 0x7FFF >> 15


def short_up(value, unit):
    return (code_up(value) + unit - 1) // unit


def bound(short, unit):
    return float(np.uint32(short * unit << 15).view(np.float32))


def direction(normal):
    x, y = normal
    z = 255 - abs(x) - abs(y)
    if z < 0:
        x, y = (x + z if x >= 0 else x - z), (y + z if y >= 0 else y - z)
    return [x, y, z]


class Compact:
    """The parts of a page after its links, in section 5."""

    def __init__(self, header, page, coder):
        self.header, self.page, self.coder, self.nodes = header, page, coder, page.nodes
        self.base = 3 * header.base_faces

    def read(self):
        self.kin()
        self.orders()
        self.half_edges()
        self.normals()
        self.places()
        self.bounds()

    def kin(self):
        for place, node in enumerate(self.nodes):
            node.place = place
            node.size, node.inside = 1, []
            if node.above is NONE:
                node.near = node.reference
            elif node.is_left or node.above.above is NONE:
                node.near = node.above
            else:
                node.near = node.above.near
        for node in reversed(self.nodes):
            children = sum(child is not NONE for child in (node.left, node.right))
            others = children - len(node.inside)
            node.size += 256 * others
            node.family = 2 if others else min(children, 1)
            node.group = 3
            if node.above is not NONE:
                node.above.inside.append(node)
                node.above.size += node.size
                node.group = 0 if node.size == 1 else 1 + (node.size > 3) + (node.size > 15)

    def orders(self):
        self.coder.tables(3)
        last = 0
        for node in self.nodes:
            if node.above is not NONE:
                down = self.coder.value(int(node.is_left))
                node.order = node.above.order - 1 - down
            else:
                last = node.order = last + self.coder.signed(2)
            assert 0 <= node.order < (1 << 32) - 1

    def half_edges(self):
        self.coder.tables(10)
        self.reverse, self.faces = {}, []
        self.last_other = self.last_base = 0
        for node in sorted(self.nodes, key=lambda node: (-node.order, node.id)):
            self.half_edges_of(node)

    def turn(self, start, steps):
        if start is NONE or steps > 31:
            return NONE
        at = start
        for done in range(steps):
            turned = self.reverse.get(before(at))
            if turned is NONE:
                return self.turn_back(start, steps - done)
            if turned == start:
                return NONE
            at = turned
        return at

    def turn_back(self, start, steps):
        at = start
        for _ in range(steps):
            turned = self.reverse.get(at)
            if turned is NONE or after(turned) == start:
                return NONE
            at = after(turned)
        return at

    def half_edges_of(self, node):
        coder, first = self.coder, self.base + 6 * node.id
        start = NONE
        if node.above is not NONE:
            parent = self.base + 6 * node.above.id
            second = node.above.adjacent[2] is not NONE
            start = parent if node.is_left else parent + (3 if second else 1)

        def outgoing(table, skipped):
            symbol = coder.symbol(table)
            if symbol == 0:
                return NONE
            found = self.far(node) if symbol == 1 else self.turn(start, symbol - 2 + skipped)
            assert found is not NONE
            return found

        def incoming(table, expected):
            symbol = coder.symbol(table)
            if symbol < 2:
                return NONE if symbol or expected is NONE else self.reverse.get(expected)
            if symbol == 2:
                return self.far(node)
            return before(self.turn(start, symbol - 3))

        x = outgoing(0, 0)
        if x is not NONE:
            start = x
        w = incoming(1, x)
        z = outgoing(2, int(x is not NONE))
        y = incoming(3, z)
        node.adjacent = [w, x, y, z]
        pairs = [(first + 1, w), (first + 2, x)]
        if y is not NONE:
            pairs += [(first, first + 3), (first + 4, y), (first + 5, z)]
        for a, b in pairs:
            self.reverse[a] = b
            if b is not NONE:
                self.reverse[b] = a

    def far(self, node):
        coder, kind = self.coder, self.coder.symbol(4)
        if kind == 0:
            place = node.place + coder.signed(5)
            assert place >= 0
            return self.base + 6 * self.nodes[place].id + coder.symbol(6)
        if kind == 1:
            face = self.faces[-1 - coder.value(7)]
            return face + coder.symbol(6)
        if kind == 2:
            self.last_other += coder.signed(8)
            name = self.base + 6 * self.last_other + coder.symbol(6)
        else:
            assert kind == 3
            self.last_base += coder.signed(9)
            name = self.last_base
        self.faces.append(name // 3 * 3)
        return name

    def normals(self):
        self.coder.tables(4)
        for node in self.nodes:
            near = (0, 0) if node.near is node else node.near.steps
            node.steps = [step + self.coder.signed(node.group) for step in near]
            assert all(abs(step) <= 255 for step in node.steps)

    def places(self):
        self.coder.tables(8)
        for node in self.nodes:
            near = (0, 0, 0) if node.near is node else node.near.corner
            n = [a + b for a, b in zip(direction(node.steps), direction(node.near.steps))]
            sizes = [abs(c) for c in n]
            along = sizes.index(max(sizes)) if any(sizes) else 2
            b, c = (along + 1) % 3, (along + 2) % 3
            moved = [0] * 3
            moved[b] = self.coder.signed(node.group)
            moved[c] = self.coder.signed(node.group)
            flat = -(moved[b] * n[b] + moved[c] * n[c])
            # To the nearest integer, halves up.
            expected = (2 * flat * sign(n[along]) + sizes[along]) // (2 * sizes[along]) if n[along] else 0
            moved[along] = expected + self.coder.signed(4 + node.group)
            node.corner = [a + m for a, m in zip(near, moved)]
            assert all(abs(c) <= 1 << 22 for c in node.corner)
            node.position = [f32(c * self.header.step) for c in node.corner]

    def bounds(self):
        self.coder.tables(3)
        for node in reversed(self.nodes):
            if node.family:
                reach = max((distance(node, child) + child.radius for child in node.inside), default=0.0)
            else:
                reach = distance(node, node.near)
            node.radius = bound(short_up(reach, 8) + self.coder.signed(node.family), 8)
        self.coder.tables(7)
        for node in reversed(self.nodes):
            if node.family:
                expected = max((child.cone for child in node.inside), default=0)
                table = 6 if expected == 2032 else 3 + node.family
            else:
                turned = sum(abs(a - b) for a, b in zip(node.steps, node.near.steps))
                expected, table = 2032, sum(turned >= least for least in (8, 20, 48))
            node.cone = expected + self.coder.signed(table)
            assert 0 <= node.cone <= 2032
        self.coder.tables(3)
        least = short_up(self.header.error, 32)
        for node in reversed(self.nodes):
            expected = max([least] + [child.deviation for child in node.inside])
            node.deviation = expected + self.coder.signed(node.family)


def sign(value):
    return -1 if value < 0 else 1


def distance(a, b):
    x, y, z = (p - q for p, q in zip(a.position, b.position))
    return math.sqrt((x * x + y * y) + z * z)


def main():
    with open(sys.argv[1], "rb") as file:
        content = File(file.read())
    positions, triangles = content.mesh()
    with open(sys.argv[2], "wb") as out:
        out.write(struct.pack("<QQ", len(positions), len(triangles)))
        out.write(positions.astype("<f4").tobytes())
        out.write(triangles.astype("<u4").tobytes())
        if content.header.colour is not NONE:
            out.write(np.array(content.colours, np.uint8).tobytes())


if __name__ == "__main__":
    main()

"""What a SPIR-V compute shader asks of its caller: bindings, specialization constants, memory."""

import operator
import struct
from dataclasses import dataclass, field
from pathlib import Path

MAGIC = 0x07230203
# Instructions.
NAME, MEMBER_NAME, DECORATE, MEMBER_DECORATE = 5, 6, 71, 72
TYPE_BOOL, TYPE_INT, TYPE_FLOAT, TYPE_VECTOR, TYPE_MATRIX, TYPE_STRUCT, TYPE_POINTER = 20, 21, 22, 23, 24, 30, 32
CONSTANT_TRUE, CONSTANT_COMPOSITE, SPEC_TRUE, SPEC_COMPOSITE, SPEC_OP = 41, 44, 48, 51, 52
VARIABLE, COMPOSITE_EXTRACT, LOOP_MERGE = 59, 81, 246
# Decorations.
SPEC_ID, NON_WRITABLE, NON_READABLE, BINDING = 1, 24, 25, 33
# Storage classes.
UNIFORM_CONSTANT, UNIFORM, WORKGROUP, STORAGE_BUFFER = 0, 2, 4, 12
UNROLL = 1  # of a loop

# Specialization constants can be computed with these.
OPERATIONS = {
    113: lambda a: a, 114: lambda a: a, 126: operator.neg, 128: operator.add, 130: operator.sub, 132: operator.mul,
    134: operator.floordiv, 135: lambda a, b: abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1),
    137: operator.mod, 138: lambda a, b: abs(a) % abs(b) * (-1 if a < 0 else 1), 139: operator.mod,
    164: operator.eq, 165: operator.ne, 166: lambda a, b: a or b, 167: lambda a, b: a and b, 168: operator.not_,
    169: lambda c, a, b: a if c else b, 170: operator.eq, 171: operator.ne, 172: operator.gt, 173: operator.gt,
    174: operator.ge, 175: operator.ge, 176: operator.lt, 177: operator.lt, 178: operator.le, 179: operator.le,
    194: operator.rshift, 195: operator.rshift, 196: operator.lshift, 197: operator.or_, 198: operator.xor,
    199: operator.and_}


@dataclass
class Binding:
    kind: str                                 # in, out, mod, con; none: neither read nor written
    element: str                              # f32, u32, …, "f32 and u32"
    names: set = field(default_factory=set)   # of the variable, its block and the block's members


class Module:
    def __init__(self, path):
        data = Path(path).read_bytes()
        self.words = struct.unpack(f"<{len(data) // 4}I", data[:len(data) // 4 * 4])
        if len(self.words) < 5 or len(data) % 4 or self.words[0] != MAGIC:
            raise ValueError(f"{path}: not SPIR-V")
        self.names, self.member_names = {}, {}
        self.decorations, self.member_decorations = {}, {}
        self.types, self.constants, self.variables = {}, {}, []
        self.loops = 0  # those not marked to be unrolled
        at = 5
        while at < len(self.words):
            count, opcode = self.words[at] >> 16, self.words[at] & 0xffff
            if not 0 < count <= len(self.words) - at:
                raise ValueError(f"{path}: ends within an instruction")
            self._take(opcode, self.words[at + 1:at + count])
            at += count

    def _take(self, opcode, args):
        if opcode == NAME:
            self.names.setdefault(args[0], []).append(text(args[1:]))
        elif opcode == MEMBER_NAME:
            self.member_names.setdefault(args[0], {})[args[1]] = text(args[2:])
        elif opcode == DECORATE:
            self.decorations.setdefault(args[0], {})[args[1]] = args[2:]
        elif opcode == MEMBER_DECORATE:
            self.member_decorations.setdefault(args[0], {}).setdefault(args[1], {})[args[2]] = args[3:]
        elif TYPE_BOOL <= opcode <= TYPE_POINTER:
            self.types[args[0]] = (opcode, args[1:])
        elif CONSTANT_TRUE <= opcode <= SPEC_OP:
            self.constants[args[1]] = (opcode, args[0], args[2:])
        elif opcode == VARIABLE:
            self.variables.append((args[1], args[2], self.types[args[0]][1][1]))  # id, storage class, type
        elif opcode == LOOP_MERGE and not args[2] & UNROLL:
            self.loops += 1

    def bindings(self):
        """{number: Binding} of all buffers."""
        found = {}
        for variable, storage, block in self.variables:
            own = self.decorations.get(variable, {})
            if storage == UNIFORM_CONSTANT:  # a texel buffer
                found[own[BINDING][0]] = Binding("in", " and ".join(sorted(self._leaves(block))),
                                                 {*self.names.get(variable, [])} - {""})
            if storage not in (UNIFORM, STORAGE_BUFFER):
                continue
            members = [self.member_decorations[block][i] for i in range(len(self.types[block][1]))]
            readable, writable = (not (decoration in own or all(decoration in m for m in members))
                                  for decoration in (NON_READABLE, NON_WRITABLE))
            kind = ("con" if storage == UNIFORM else
                    {(True, True): "mod", (True, False): "in", (False, True): "out"}.get((readable, writable), "none"))
            names = {*self.names.get(variable, []), *self.names.get(block, []),
                     *self.member_names.get(block, {}).values()} - {""}
            found[own[BINDING][0]] = Binding(kind, " and ".join(sorted(self._leaves(block))), names)
        return found

    def _leaves(self, type_id):
        opcode, args = self.types[type_id]
        if opcode == TYPE_FLOAT:
            return {f"f{args[0]}"}
        if opcode == TYPE_INT:
            return {f"{'i' if args[1] else 'u'}{args[0]}"}
        if opcode == TYPE_BOOL:
            return {"bool"}
        return set().union(*map(self._leaves, args if opcode == TYPE_STRUCT else args[:1]))

    def specializations(self):
        """{id: (names, default)}; a constant equal to another, as `const int B = A`, only gives it a second name."""
        return {decorations[SPEC_ID][0]: (self.names.get(constant, []), self.value(constant, {}))
                for constant, decorations in self.decorations.items() if SPEC_ID in decorations}

    def value(self, constant, given):
        """Of a constant, with {specialization id: value} instead of the defaults."""
        opcode, type_id, args = self.constants[constant]
        number = self.decorations.get(constant, {}).get(SPEC_ID, (None,))[0]
        if number in given:
            return given[number]
        if not args:  # true, false or null
            return opcode in (CONSTANT_TRUE, SPEC_TRUE)
        if opcode in (CONSTANT_COMPOSITE, SPEC_COMPOSITE):
            return [self.value(arg, given) for arg in args]
        if opcode == SPEC_OP and args[0] == COMPOSITE_EXTRACT:
            return self.value(args[1], given)[args[2]]
        if opcode == SPEC_OP:
            return OPERATIONS[args[0]](*(self.value(arg, given) for arg in args[1:]))
        kind, format_ = self.types[type_id]
        return struct.unpack("<f" if kind == TYPE_FLOAT else "<i" if format_[1] else "<I",
                             struct.pack("<I", args[0]))[0]

    def shared_bytes(self, given):
        """Of shared memory, laid out as std430 would."""
        total = 0
        for _, storage, type_id in self.variables:
            if storage == WORKGROUP:
                size, align = self._size(type_id, given)
                total = round_up(total, align) + size
        return total

    def _size(self, type_id, given):
        """(bytes, alignment)."""
        opcode, args = self.types[type_id]
        if opcode == TYPE_BOOL:
            return 4, 4
        if opcode in (TYPE_INT, TYPE_FLOAT):
            return args[0] // 8, args[0] // 8
        if opcode == TYPE_STRUCT:
            end = widest = 0
            for size, align in (self._size(arg, given) for arg in args):
                end, widest = round_up(end, align) + size, max(widest, align)
            return round_up(end, widest), widest
        size, align = self._size(args[0], given)
        if opcode == TYPE_VECTOR:
            return size * args[1], size * (4 if args[1] == 3 else args[1])
        count = args[1] if opcode == TYPE_MATRIX else self.value(args[1], given)
        return count * round_up(size, align), align

    def float_widths(self):
        return {args[0] for opcode, args in self.types.values() if opcode == TYPE_FLOAT}


def text(words):
    return struct.pack(f"<{len(words)}I", *words).split(b"\0")[0].decode()


def round_up(size, multiple):
    return (size + multiple - 1) // multiple * multiple

"""How Cryptomatte numbers objects and materials."""

import struct


def name_number(name):
    """The number by which Cryptomatte knows a block: MurmurHash3 of its name, as a float's bits.

    Source: Austin Appleby, MurmurHash3_x86_32 (public domain); Psyop's Cryptomatte specification.
    """
    data, mask = name.encode(), 0xFFFFFFFF

    def turned(value, by):
        return (value << by | value >> (32 - by)) & mask

    def scrambled(block):
        return turned(block * 0xCC9E2D51 & mask, 15) * 0x1B873593 & mask

    number, whole = 0, len(data) & ~3
    for (block,) in struct.iter_unpack("<I", data[:whole]):
        number = (turned(number ^ scrambled(block), 13) * 5 + 0xE6546B64) & mask
    if len(data) > whole:
        number ^= scrambled(int.from_bytes(data[whole:], "little"))
    number ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        number = (number ^ number >> shift) * factor & mask
    # A float that is neither zero-like nor infinite.
    exponent = min(max(number >> 23 & 255, 1), 254)
    return number & 0x807FFFFF | exponent << 23

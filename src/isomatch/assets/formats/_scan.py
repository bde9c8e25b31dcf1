"""Compiled loops over the bytes of a text file: its lines without comments, some of these lines, their numbers.

Words are separated by single bytes, and each line is closed by a newline, once `normalise` has passed over them.
"""

from __future__ import annotations

import numpy as np

from isomatch.loading.compiled import compiled
from isomatch.values.arrays import AnyArray, FloatArray, IntArray

SPACE, NEWLINE, RETURN, BACKSLASH, SLASH, HASH = b" \n\r\\/#"
PLUS, MINUS, POINT, ZERO, CAPITAL_E, SMALL_E = b"+-.0Ee"
POWERS = np.array([[float(10**k), float(10**k - int(float(10**k)))] for k in range(200)])
"""Powers of ten, as the nearest float and the nearest of the rest."""
MOST_DIGITS = 18
"""Digits of an integer that always fits 64 bits."""


@compiled()
def normalise(
    octets: AnyArray, table: AnyArray, continued: bool, lines: AnyArray, numbers: IntArray, number: int
) -> tuple[int, int]:
    """Copy lines without comments, blank lines and leading blanks; return how many bytes and how many lines there are.

    ``number`` is that of the first line. The table makes spaces of blanks. Every kind of line end becomes a newline, and
    a continued line is joined to the next.
    """
    n, size, row, start = len(octets), 0, 0, 0
    line, last, comment = number, NEWLINE, False
    # two line ends are added: they close the last line, and let it not be continued
    for k in range(n + 2):
        octet = table[octets[k]] if k < n else NEWLINE
        if octet > HASH and octet != BACKSLASH and not comment:  # nearly all of them
            lines[size] = last = octet
            size += 1
            continue
        if octet == RETURN:
            if k + 1 < n and octets[k + 1] == NEWLINE:
                continue
            octet = NEWLINE
        goes_on = continued and last == BACKSLASH
        last = octet
        if octet == NEWLINE:
            line += 1
            if goes_on:
                if not comment:
                    lines[size - 1] = SPACE
                    if size - 1 == start:
                        size = start
                    else:
                        lines[size] = SPACE
                        size += 1
                continue
            if size > start:
                lines[size] = NEWLINE
                size += 1
                numbers[row] = number
                row += 1
                start = size
            number, comment = line, False
        elif octet == HASH:
            comment = True
        elif not comment and (octet != SPACE or size > start):
            lines[size] = octet
            size += 1
    return size, row


@compiled()
def count_plain_lines(octets: AnyArray) -> int:
    """Return the number of lines if `normalise` would change none of them, which is most often so; otherwise -1.

    Without a branch in the loop, so that it runs over many bytes at once.
    """
    other, n_lines = np.uint8(0), 0
    for k in range(len(octets) - 1):
        octet, after = octets[k], octets[k + 1]
        ends = octet == NEWLINE
        other |= ((octet < SPACE) & ~ends) | (octet > 126) | (octet == HASH) | (octet == BACKSLASH)
        other |= ends & ((after == NEWLINE) | (after == SPACE))
        n_lines += ends
    if other or not len(octets) or octets[0] <= SPACE or octets[-1] != NEWLINE:
        return -1
    return n_lines + 1


@compiled()
def select(
    lines: AnyArray,
    keyword: AnyArray,
    textured: bool,
    numbers: IntArray,
    chosen: AnyArray,
    chosen_numbers: IntArray,
) -> tuple[int, int]:
    """Copy the rest of each line whose first word is a keyword; return how many bytes and how many lines there are.

    Of a ``textured`` word ``v/vt/vn`` only the first number is copied, if it ends in a digit.
    """
    size, row, k = 0, 0, 0
    for line in range(len(numbers)):
        i = 0
        while i < len(keyword) and lines[k] == keyword[i]:
            i += 1
            k += 1
        if i == len(keyword) and (lines[k] == SPACE or lines[k] == NEWLINE):
            digit = False
            while lines[k] != NEWLINE:
                if textured and digit and lines[k] == SLASH:
                    after = k
                    for _ in range(2):
                        if lines[after] == SLASH:
                            after += 1
                            if lines[after] == MINUS:
                                after += 1
                            while 0 <= lines[after] - ZERO < 10:
                                after += 1
                    if lines[after] == SPACE or lines[after] == NEWLINE:
                        k = after
                        digit = False
                        continue
                digit = 0 <= lines[k] - ZERO < 10
                chosen[size] = lines[k]
                size += 1
                k += 1
            chosen[size] = NEWLINE
            size += 1
            chosen_numbers[row] = numbers[line]
            row += 1
        while lines[k] != NEWLINE:
            k += 1
        k += 1
    return size, row


@compiled()
def field_of_words(lines: AnyArray, which: int, fields: AnyArray) -> int:
    """Copy of each word the field after so many slashes, or 0 if that is empty; return how many bytes there are."""
    size, k = 0, 0
    while k < len(lines):
        if lines[k] == SPACE or lines[k] == NEWLINE:
            fields[size] = lines[k]
            size += 1
            k += 1
            continue
        slashes, start = 0, size
        while lines[k] != SPACE and lines[k] != NEWLINE:
            if lines[k] == SLASH:
                slashes += 1
            elif slashes == which:
                fields[size] = lines[k]
                size += 1
            k += 1
        if size == start:
            fields[size] = ZERO
            size += 1
    return size


@compiled(error_model="numpy")
def parse(lines: AnyArray, powers: FloatArray, at: IntArray, values: FloatArray, counts: IntArray) -> bool:
    """Parse words as floats, from byte, value and row ``at`` on, to the end or to a word for which this is too simple.

    Returns whether the end was reached. A value is the nearest float: it is the quotient or the product of an integer
    and a power of ten, with the rounding error of both, and words where that leaves a doubt are left to the caller.
    """
    k, count, row = at[0], at[1], at[2]
    while k < len(lines):
        octet = lines[k]
        if octet == SPACE:
            k += 1
            continue
        if octet == NEWLINE:
            k += 1
            row += 1
            continue
        at[0], at[1], at[2] = k, count, row
        negative = octet == MINUS
        if negative or octet == PLUS:
            k += 1
        mantissa, digits, scale, point, inexact = 0, 0, 0, False, False
        first = k
        while True:
            digit = lines[k] - ZERO
            if 0 <= digit < 10:
                if digits < MOST_DIGITS:
                    mantissa = 10 * mantissa + digit
                    digits += mantissa > 0
                    scale -= point
                else:
                    inexact |= digit > 0
                    scale += not point
            elif lines[k] == POINT and not point:
                point = True
            else:
                break
            k += 1
        if k - first == point:
            return False
        if lines[k] == SMALL_E or lines[k] == CAPITAL_E:
            k += 1
            sign = 1
            if lines[k] == MINUS or lines[k] == PLUS:
                sign = -1 if lines[k] == MINUS else 1
                k += 1
            first, exponent = k, 0
            while 0 <= lines[k] - ZERO < 10:
                if exponent < 1000:
                    exponent = 10 * exponent + lines[k] - ZERO
                k += 1
            if k == first:
                return False
            scale += sign * exponent
        if lines[k] != SPACE and lines[k] != NEWLINE:
            return False
        high = np.float64(mantissa)
        if mantissa and scale:
            if not -len(powers) < scale < len(powers):
                return False
            power, power_rest = powers[abs(scale), 0], powers[abs(scale), 1]
            rest = np.float64(mantissa - np.int64(high))
            # high + low is the value to twice the precision of a float (Dekker, Numer. Math. 1971)
            if scale > 0:
                value = high * power
                low = _product_error(high, power, value) + (rest * power + high * power_rest)
            else:
                value = high / power
                product = value * power
                left = (high - product) - _product_error(value, power, product)
                low = (left + (rest - value * power_rest)) / power
            doubt = value * (1.1e-17 if inexact else 1e-29)
            high = value + (low - doubt)
            if high != value + (low + doubt):
                return False
        elif inexact:
            return False
        values[count] = -high if negative else high
        counts[row] += 1
        count += 1
    return True


@compiled(error_model="numpy")
def _product_error(a: float, b: float, product: float) -> float:
    """Compute what rounding took from the product of two floats, by Dekker's splitting."""
    a_high = 134217729.0 * a
    a_high -= a_high - a
    b_high = 134217729.0 * b
    b_high -= b_high - b
    a_low, b_low = a - a_high, b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low

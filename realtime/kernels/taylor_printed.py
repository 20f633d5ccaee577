# SPDX-License-Identifier: BSD-3-Clause
"""The coefficients of the polynomial of Biri, Arques and Michelin 2006 as its annex has them, misprints included.

`realtime.kernels.taylor` derives them and integrates either, so that the paper's own error can be shown. With a =
sigma_t h, the factor e^-a left out, and an asterisk where the printed term is not the derived one (DESIGN section 3):

    isotropic   1;   -a;   a^2 - a *;   -a^3/6 + a^2/2 - a *;   a^4/24 - a^3/4 + 11 a^2/24 - 5 a/24
    Rayleigh    3/4;   -3a/4;   3a^2/8 + 3/4 *
    hazy        265/256;   -265a/256 + 9/36 *;   265a^2/256 - 121a/512 + 63/64 *
    murky       n/2^31;   +n a/2^31 - 25/367108864 *;   n a^2/2^32 - 2147482073 a/2^32 + 775/134217728

where n = 2147483673. Derived, the six starred terms are (a^2 - a)/2; -a^3/6 + a^2/2 - a/3; 3a^2/8 - 3a/8 + 3/4;
-265a/256 - 9/32; 265a^2/512 - 121a/512 + 63/64; -n a/2^31 - 25/67108864. The text at hand comes from scanned pages: a
wrong digit may be the scan's.

Two choices let it be compared with other kernels:

* The printed hazy and murky functions, 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means 2 and 83/33 over the
  sphere: all their coefficients are divided by these.
* For all but the isotropic function the annex ends with "..." after c_2. The missing c_3 and c_4 are the derived ones,
  so that whatever differs from the derived polynomial of the same degree is the print's.
"""

PRINTED_PHASES = ("isotropic", "rayleigh", "hazy", "murky")
HIGHEST_DEGREE = 4


def printed_coefficients(a, name: str) -> list:
    """Return the printed coefficients of theta^0, theta^1, ..., without e^-a, over the phase function's mean [1].

    Parameters
    ----------
    a
        sigma_t h [1], a number or an array of any kind.
    name
        'isotropic' (five coefficients), 'rayleigh', 'hazy' or 'murky' (three).
    """
    unit = 0 * a + 1
    if name == "isotropic":
        return [
            unit,
            -a,
            a * a - a,
            -(a * a * a) / 6 + a * a / 2 - a,
            a * a * a * a / 24 - a * a * a / 4 + 11 * a * a / 24 - 5 * a / 24,
        ]
    if name == "rayleigh":
        return [0.75 * unit, -0.75 * a, 0.375 * a * a + 0.75]
    if name == "hazy":
        return [
            265 / 256 / 2 * unit,
            (-265 / 256 * a + 9 / 36) / 2,
            (265 / 256 * a * a - 121 / 512 * a + 63 / 64) / 2,
        ]
    head, mean = 2147483673 / 2147483648, 83 / 33
    return [
        head / mean * unit,
        (head * a - 25 / 367108864) / mean,
        (head / 2 * a * a - 2147482073 / 4294967296 * a + 775 / 134217728) / mean,
    ]

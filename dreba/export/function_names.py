"""Names that an exported function may have, in C, C++, Python and CasADi alike."""

from __future__ import annotations

import builtins
import keyword
import re
from typing import Final

from dreba.errors import ModelError
from dreba.export import c_soft_template, c_templates

_C: Final = """
auto break case char const continue default do double else enum extern float for goto if inline int long main register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool
"""
_CPP: Final = """
alignas alignof and and_eq asm bitand bitor catch char8_t char16_t char32_t class co_await co_return co_yield compl
concept const_cast consteval constexpr constinit decltype delete dynamic_cast explicit export false friend mutable
namespace new noexcept not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires
static_assert static_cast std template this thread_local throw true try typeid typename using virtual wchar_t xor xor_eq
"""
_LIBRARY: Final = """
a64l abort abs acos acosh aligned_alloc alloca arc4random arc4random_buf arc4random_uniform asin asinh atan atan2
atanh atexit atof atoi atol be16toh be32toh be64toh bsearch calloc canonicalize canonicalize_file_name cbrt ceil
clearenv clock close copysign cos cosh daddl ddivl dfmal div dmull drand48 drem dsqrtl dsubl ecvt erand48 erf erfc
errno exit exp exp10f exp10l exp2 expm1 fabs fadd fclose fcvt fd_mask fd_set fdim fdiv ffma finite floor fma fmax
fmaximum fmaximum_mag fmaximum_mag_num fmaximum_num fmaxmag fmin fminimum fminimum_mag fminimum_mag_num fminimum_num
fminmag fmod fmul fopen fpclassify fprintf fputs fread free frexp fromfp fromfpx fscanf fsqrt fsub fwrite gamma gcvt
getchar getenv getloadavg getpayload getpt gets getsubopt grantpt htobe16 htobe32 htobe64 htole16 htole32 htole64
hypot ilogb index initstate isfinite isgreater isgreaterequal isinf isless islessequal islessgreater isnan isnormal
issubnormal isunordered j0 j1 jn jrand48 l64a labs lcong48 ldexp ldiv le16toh le32toh le64toh lgamma linux llabs lldiv
llogb llrint llround log log10 log1p log2 logb lrand48 lrint lround malloc math_errhandling mblen mbstowcs mbtowc
memchr memcmp memcpy memmove memset mkdtemp mkostemp mkostemps mkstemp mkstemps mktemp modf mrand48 nan nearbyint
nextafter nextdown nexttoward nextup nrand48 offsetof on_exit open perror posix_memalign posix_openpt pow printf
pselect ptsname putchar putenv puts qecvt qfcvt qgcvt qsort quick_exit raise rand random read realloc reallocarray
realpath remainder remove remquo rename rint round roundeven rpmatch scalb scalbln scalbn scanf secure_getenv seed48
select setenv setpayload setpayloadsig setstate signal signbit signgam significand sin sincos sinh sprintf sqrt srand
srandom stderr stdin stdout strcat strchr strcmp strcpy strfromd strfromf strfroml strlen strtod strtof strtol strtoq
strtoul strtouq system tan tanh tgamma time tolower totalorder totalordermag toupper trunc u_char u_int u_long u_short
ufromfp ufromfpx uint ulong unix unlockpt unsetenv ushort valloc wcstombs wctomb write y0 y1 yn
"""
_OWN: Final = "JOINTS angles joints load coupling activity gradient hessian torch jax jnp np math null jac hess"
REFUSED: Final = frozenset(
    (*_C.split(), *_CPP.split(), *_LIBRARY.split(), *_OWN.split(), *keyword.kwlist, *dir(builtins))
)
"""Keywords of C99, C++20 and Python, names of the C library that the headers declare or most programs link, and names
that the files use."""
_FUNCTIONS: Final = frozenset(_LIBRARY.split())
_SUFFIX: Final = re.compile(r"[fdl]?(\d+x?)?(_[rl])?")
"""What follows the name of a function in that for another type, such as sinf or strtof32_l."""
_NO_FUNCTION: Final = re.compile(r"M_.*|.*_t|f\d+x?(add|div|fma|mul|sqrt|sub)f\d+x?")
"""Constants of math.h, types of POSIX, and functions of two types."""
_TEMPLATES: Final = [text for part in (c_templates, c_soft_template) for text in vars(part).values()]
DERIVED: Final = frozenset(
    ending for text in _TEMPLATES if isinstance(text, str) for ending in re.findall(r"\$\{name\}_(\w+)", text)
)
"""What C files put behind the name of a function and an underscore, for functions, tables and macros of their own."""
_OF_ANOTHER: Final = re.compile(rf"(\w+)_({'|'.join(sorted(DERIVED))})")
"""Where no name ends like this and no ending has another one behind an underscore, no two exports share a name."""
LONGEST: Final = 63 - max(len(f"_{ending}") for ending in DERIVED)
"""Characters of a name: with every ending no more than those of which C compilers must tell the differences."""


def check_name(name: str) -> None:
    """Refuse a name that a compiler, a linker or CasADi would refuse or mistake (ModelError).

    Example:
        >>> check_name("int")
        Traceback (most recent call last):
        dreba.errors.ModelError: name is 'int', which is reserved; give another, such as 'dreba'
    """
    if not (name.isidentifier() and name.isascii()) or len(name) > LONGEST:
        raise ModelError(
            f"name is {name[:80]!r}; expected letters, digits and underscores, at most {LONGEST}, such as 'dreba'"
        )
    if (derived := _OF_ANOTHER.fullmatch(name)) is not None:
        raise ModelError(
            f"name is {name!r}, which belongs to an export named {derived[1]!r}: both would not fit into one program; "
            "give another, such as 'dreba'"
        )
    if name in REFUSED or name.startswith("_") or "__" in name or name.isupper() or _is_variant(name):
        raise ModelError(f"name is {name!r}, which is reserved; give another, such as 'dreba'")


def _is_variant(name: str) -> bool:
    """Return whether a name is that of a type, a constant or a function for other types of the C library."""
    if _NO_FUNCTION.fullmatch(name):
        return True
    return any(name[:end] in _FUNCTIONS and _SUFFIX.fullmatch(name[end:]) for end in range(1, len(name)))

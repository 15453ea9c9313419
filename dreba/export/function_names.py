"""Names that an exported function may have, in C, C++, Python and CasADi alike."""

from __future__ import annotations

import builtins
import keyword
from typing import Final

from dreba.errors import ModelError

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
acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma fmax fmin
fmod frexp gamma hypot ilogb isfinite isinf isnan j0 j1 jn ldexp lgamma log log10 log1p log2 logb lrint lround modf nan
nearbyint nextafter pow remainder remquo rint round scalbn signbit sin sinh sqrt tan tanh tgamma trunc y0 y1 yn abort
abs atexit atof atoi atol bsearch calloc clock close div errno exit fclose fopen fprintf fputs fread free fscanf fwrite
getchar getenv gets index labs malloc memchr memcmp memcpy memmove memset offsetof open perror printf putchar puts qsort
raise rand read realloc remove rename scanf signal sprintf srand stderr stdin stdout strcat strchr strcmp strcpy strlen
system time tolower toupper write NULL NAN INFINITY DBL_MAX HUGE_VAL EOF
"""
_OWN: Final = "angles joints load coupling activity gradient hessian torch jax jnp np math null jac hess"
REFUSED: Final = frozenset(
    (*_C.split(), *_CPP.split(), *_LIBRARY.split(), *_OWN.split(), *keyword.kwlist, *dir(builtins))
)
"""Keywords of C99, C++20 and Python, names of the C library that a program links, and names that the files use."""
LONGEST: Final = 63
"""Characters of a name of which C compilers must tell the differences."""


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
    if name in REFUSED or name.startswith("_") or "__" in name:
        raise ModelError(f"name is {name!r}, which is reserved; give another, such as 'dreba'")

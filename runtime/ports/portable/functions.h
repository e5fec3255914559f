// Every source of a portable build (EXMAT_PORTABLE) includes this first. The last bits of these functions differ
// between C libraries, so calls of them, those of Eigen too, are linked to the functions of functions.cpp. The module
// of WebAssembly defines them by their own names instead: libc++ calls no others.
#pragma once

#ifdef __wasi__

#define exmat_portable_sin sin
#define exmat_portable_cos cos
#define exmat_portable_acos acos
#define exmat_portable_atan2 atan2
#define exmat_portable_log log
#define exmat_portable_log1p log1p

#else

#include <cmath>

#define EXMAT_LINKED_AS(name) __asm__("exmat_portable_" #name)

extern "C" {
double sin(double) EXMAT_LINKED_AS(sin);
double cos(double) EXMAT_LINKED_AS(cos);
double acos(double) EXMAT_LINKED_AS(acos);
double atan2(double, double) EXMAT_LINKED_AS(atan2);
double log(double) EXMAT_LINKED_AS(log);
double log1p(double) EXMAT_LINKED_AS(log1p);
}

#endif

/* Macros for loops by vector instructions. */
#ifndef LATINVECTOR_H
#define LATINVECTOR_H

#include <stdlib.h> /* defines __GLIBC__ */

/* LATIN_CLONES: compiles a function for several instruction sets, one of which is chosen for the processor at run time */
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 12 && defined(__x86_64__) && defined(__GLIBC__)
  #define LATIN_CLONES      __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
  #define LatinClonesWide() __builtin_cpu_supports("avx512vl") /* whether the first of them is chosen */
#else
  #define LATIN_CLONES
  #define LatinClonesWide() 0
#endif
#if defined(__GNUC__)
  #define LATIN_INLINE static inline __attribute__((always_inline))
#else
  #define LATIN_INLINE static inline
#endif

#endif

/* How functions are compiled, and those that are parts of them; what all sources include, which also tells of __GLIBC__. */

#include <math.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && __GNUC__ >= 12
#define FAST __attribute__((target_clones("arch=x86-64-v3", "default"))) /* multiplies and adds at once where the processor can */
#else
#define FAST
#endif
#define INSIDE static inline __attribute__((always_inline))

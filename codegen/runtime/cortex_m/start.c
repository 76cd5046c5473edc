/* Start of a Cortex-M with a floating-point unit, and what compilers take for granted of a C library.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <stddef.h>
#include <stdint.h>

#include "board.h"

extern uint32_t data_start[], data_end[], data_load[], bss_start[], bss_end[], stack_limit[], stack_top[];
int main(void);
void start(void);
static void fault(void);
static void failed(void);

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16] = {
    (uintptr_t)stack_top, (uintptr_t)start, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault, (uintptr_t)fault};

/* Semihosting: asks the debugger, or QEMU. */
static int asked(int operation, const void *about)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = about;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void print(const char *text)
{
    asked(0x04, text);
}

void leave(int code)
{
    const uint32_t reason[2] = {0x20026, (uint32_t)code}; /* application exit */
    asked(0x20, reason);
    for (;;)
        ;
}

/* The stack may be what is at fault: begin it again. */
__attribute__((naked)) static void fault(void)
{
    __asm__ volatile("ldr r0, =stack_top\n mov sp, r0\n b failed");
}

__attribute__((used)) static void failed(void)
{
    print("fault: the stack, or the memory, is too small\n");
    leave(1);
}

/* Where newlib's sinf and its like tell of an argument that has no value. */
int *__errno(void);
int *__errno(void)
{
    static int number;
    return &number;
}

/* All of the stack below here is marked; how deep it was since then shows. */
#define MARK 0x5a5a5a5au

__attribute__((noinline)) void mark_stack(void)
{
    volatile uint32_t *word = (volatile uint32_t *)__builtin_frame_address(0) - 32;
    while (word > (volatile uint32_t *)stack_limit)
        *--word = MARK;
}

unsigned used_stack(void)
{
    const uint32_t *word = stack_limit;
    while (word < stack_top && *word == MARK)
        word++;
    return (unsigned)((uintptr_t)stack_top - (uintptr_t)word);
}

/* SysTick counts down at the processor's clock; in QEMU with -icount shift=0 an instruction takes a nanosecond. */
#define SYSTICK ((volatile uint32_t *)0xe000e010u)

void start_count(void)
{
    SYSTICK[0] = 0;
    SYSTICK[1] = 0xffffff;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
}

unsigned count(void)
{
    return (0u - SYSTICK[2]) & 0xffffffu; /* zero until the first tick */
}

void start(void)
{
    uint32_t *to = data_start;
    const uint32_t *from = data_load;
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\n isb");
    while (to < data_end)
        *to++ = *from++;
    for (to = bss_start; to < bss_end;)
        *to++ = 0;
    leave(main());
}

void *memcpy(void *restrict to, const void *restrict from, size_t n)
{
    unsigned char *d = to;
    const unsigned char *s = from;
    while (n--)
        *d++ = *s++;
    return to;
}

void *memset(void *to, int value, size_t n)
{
    unsigned char *d = to;
    while (n--)
        *d++ = (unsigned char)value;
    return to;
}

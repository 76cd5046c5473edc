/* What programs here ask of the board.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#ifndef BOARD_H
#define BOARD_H

void print(const char *text);
void leave(int code) __attribute__((noreturn));
void mark_stack(void);
unsigned used_stack(void); /* bytes, since it was marked */
void start_count(void);
unsigned count(void); /* ticks of the processor's clock */

#endif

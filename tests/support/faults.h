/* What a test has fail on purpose: memory, the device, a database. The library's own calls alone are met, not those
 * that drivers and other libraries make: the linker puts faults.c before them (--wrap, see FAULTS in the Makefile). */
#ifndef KARST_TESTS_SUPPORT_FAULTS_H
#define KARST_TESTS_SUPPORT_FAULTS_H

#include <stdbool.h>

/* The n-th allocation from now on fails, once, from whatever thread; 0: the next one; below 0: none. */
void faults_fail_memory(long n);
/* Whether it came to that since then. */
bool faults_memory_failed(void);

/* From now on the device takes no buffer, no program, no launch, and gives nothing back; and no library is found that
 * is loaded when it is needed (EGL, OSMesa). */
void faults_fail_device(bool fails);

/* From now on SQLite answers with this code; 0 (SQLITE_OK): as it does. */
void faults_fail_database(int code);

#endif

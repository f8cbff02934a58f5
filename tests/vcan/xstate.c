/* Preloaded into Debian's user-mode kernel 6.1 on processors with AMX.
 *
 * That kernel keeps 2,696 bytes of extended processor state (x87 to AVX-512 and protection keys) and hands so many to
 * PTRACE_SETREGSET. The machine's kernel wants all of what the processor may have, 11,008 bytes with AMX, and answers
 * EFAULT to less; the user-mode kernel then dies as it starts its first process. A short state is handed on here with
 * zeros behind it: features that its header does not name are left in their initial state, and nothing uses AMX without
 * asking for it first.
 *
 * Every other request goes through as it is. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

typedef long call(enum __ptrace_request, pid_t, void *, void *);

long ptrace(enum __ptrace_request request, ...)
{
    static call *next;
    static char whole[65536];
    va_list list;
    va_start(list, request);
    pid_t pid = va_arg(list, pid_t);
    void *address = va_arg(list, void *);
    void *data = va_arg(list, void *);
    va_end(list);
    if (!next)
        next = (call *)dlsym(RTLD_NEXT, "ptrace");
    if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE) {
        const struct iovec *given = data;
        struct iovec all = {whole, sizeof whole};
        /* How much there is, is told with what is there. */
        if (next(PTRACE_GETREGSET, pid, address, &all) == 0 && given->iov_len < all.iov_len) {
            memcpy(whole, given->iov_base, given->iov_len);
            memset(whole + given->iov_len, 0, all.iov_len - given->iov_len);
            return next(request, pid, address, &all);
        }
    }
    return next(request, pid, address, data);
}

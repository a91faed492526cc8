/* Preloaded (LD_PRELOAD): counts the calls that act on a folder, and kills the process or fails at one of them.

fault_plan(folder, n, action, number) begins to count at the next call. The n-th call, from 1:
  KILL    ends the process; a write has written half its bytes by then
  FAIL    returns the error `number`, once
  FULL    returns the error `number`, as do all later calls that take space; a write first writes half its bytes
  SIGNAL  first sends the signal `number` to the process
fault_calls() gives the calls that were counted, one a line: name, and the last part of the path. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

enum { NONE, KILL, FAIL, FULL, SIGNAL };

static char watched[PATH_MAX], calls[1 << 16];
static long target, count;
static int action, number, active;

void fault_plan(const char *folder, long n, int what, int value) {
    if (realpath(folder, watched) == NULL) abort();
    target = n, action = what, number = value, count = 0, calls[0] = 0, active = 1;
}

const char *fault_calls(void) { return calls; }

static void name_of(int descriptor, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, PATH_MAX - 1);
    path[length > 0 ? length : 0] = 0;
}

/* 0: go on; 1: fail with errno set. space: whether the call takes room on the disk. */
static int fault(const char *call, int folder, const char *path, int space) {
    char whole[2 * PATH_MAX + 2], at[PATH_MAX];
    if (!active) return 0;
    if (path == NULL) name_of(folder, whole);
    else if (path[0] == '/') snprintf(whole, sizeof whole, "%s", path);
    else {
        if (folder == AT_FDCWD) { if (getcwd(at, sizeof at) == NULL) return 0; }
        else name_of(folder, at);
        snprintf(whole, sizeof whole, "%s/%s", at, path);
    }
    size_t length = strlen(watched);
    if (strncmp(whole, watched, length) != 0 || (whole[length] != '/' && whole[length] != 0)) return 0;
    ++count;
    size_t used = strlen(calls);
    snprintf(calls + used, sizeof calls - used, "%s %s\n", call, whole[length] ? whole + length + 1 : ".");
    int now = count == target;
    if (now && action == KILL) return 2;
    if (now && action == SIGNAL) kill(getpid(), number);
    if ((now && (action == FAIL || action == FULL)) || (action == FULL && target && count > target && space)) {
        errno = number;
        return now && action == FULL ? 3 : 1;
    }
    return 0;
}

static void end(void) { kill(getpid(), SIGKILL); pause(); }

#define REAL(type, name, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = (type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)
#define GUARD(call, folder, path, space) \
    switch (fault(call, folder, path, space)) { case 0: break; case 2: end(); default: return -1; }

#define OPEN(function, name, at, folder, ...) \
    int function(__VA_ARGS__, int flags, ...) { \
        REAL(int, name, __VA_ARGS__, int, ...); \
        mode_t mode = 0; \
        if (flags & (O_CREAT | O_TMPFILE)) { va_list more; va_start(more, flags); mode = va_arg(more, mode_t); va_end(more); } \
        GUARD(flags & O_ACCMODE ? "open to write" : "open", folder, path, flags & O_CREAT) \
        return real(at path, flags, mode); \
    }
#define COMMA ,
OPEN(open, "open", , AT_FDCWD, const char *path)
OPEN(open64, "open64", , AT_FDCWD, const char *path)
OPEN(openat, "openat", folder COMMA, folder, int folder, const char *path)
OPEN(openat64, "openat64", folder COMMA, folder, int folder, const char *path)

ssize_t write(int descriptor, const void *data, size_t size) {
    REAL(ssize_t, "write", int, const void *, size_t);
    switch (fault("write", descriptor, NULL, 1)) {
    case 0: return real(descriptor, data, size);
    case 2: if (real(descriptor, data, size / 2) >= 0) end();
    case 3: if (size > 1) return real(descriptor, data, size / 2); /* the rest fails */
    default: errno = number; return -1;
    }
}

int fsync(int descriptor) {
    REAL(int, "fsync", int);
    GUARD("fsync", descriptor, NULL, 1)
    return real(descriptor);
}

int rename(const char *from, const char *to) {
    REAL(int, "rename", const char *, const char *);
    GUARD("rename to", AT_FDCWD, to, 1)
    return real(from, to);
}

int renameat(int a, const char *from, int b, const char *to) {
    REAL(int, "renameat", int, const char *, int, const char *);
    GUARD("rename to", b, to, 1)
    return real(a, from, b, to);
}

int renameat2(int a, const char *from, int b, const char *to, unsigned flags) {
    REAL(int, "renameat2", int, const char *, int, const char *, unsigned);
    GUARD(flags & 2 ? "exchange with" : "rename to", b, to, 1)
    return real(a, from, b, to, flags);
}

int link(const char *from, const char *to) {
    REAL(int, "link", const char *, const char *);
    GUARD("link to", AT_FDCWD, to, 1)
    return real(from, to);
}

int linkat(int a, const char *from, int b, const char *to, int flags) {
    REAL(int, "linkat", int, const char *, int, const char *, int);
    GUARD("link to", b, to, 1)
    return real(a, from, b, to, flags);
}

int mkdir(const char *path, mode_t mode) {
    REAL(int, "mkdir", const char *, mode_t);
    GUARD("mkdir", AT_FDCWD, path, 1)
    return real(path, mode);
}

int unlink(const char *path) {
    REAL(int, "unlink", const char *);
    GUARD("unlink", AT_FDCWD, path, 0)
    return real(path);
}

int unlinkat(int folder, const char *path, int flags) {
    REAL(int, "unlinkat", int, const char *, int);
    GUARD(flags & AT_REMOVEDIR ? "rmdir" : "unlink", folder, path, 0)
    return real(folder, path, flags);
}

int rmdir(const char *path) {
    REAL(int, "rmdir", const char *);
    GUARD("rmdir", AT_FDCWD, path, 0)
    return real(path);
}

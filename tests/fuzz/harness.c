#include "harness.h"
#undef calloc
#undef realloc
#undef free
#undef exit
#undef fopen
#undef fclose
#undef XML_ParserCreate

#include <errno.h>
#include <setjmp.h>
#include <string.h>

/* Stands before every block; the blocks in use are a ring. */
typedef union Block Block;
union Block {
    struct {
        Block *next, *previous;
    } in;
    long double aligned;
};

FILE *fuzz_messages;
static Block ring = {{&ring, &ring}};
static jmp_buf start;
static FILE *opened;
static const uint8_t *input;
static size_t input_size;

static void *link_in(Block *block)
{
    if (!block)
        return NULL;
    block->in.next = ring.in.next;
    block->in.previous = &ring;
    ring.in.next->in.previous = block;
    ring.in.next = block;
    return block + 1;
}

static Block *unlinked(void *memory)
{
    Block *block = memory ? (Block *)memory - 1 : NULL;
    if (block) {
        block->in.next->in.previous = block->in.previous;
        block->in.previous->in.next = block->in.next;
    }
    return block;
}

void *fuzz_calloc(size_t count, size_t size)
{
    if (size && count > (SIZE_MAX - sizeof(Block)) / size)
        return NULL;
    return link_in(calloc(1, sizeof(Block) + count * size));
}

static void *fuzz_malloc(size_t size) { return link_in(malloc(sizeof(Block) + size)); }

void *fuzz_realloc(void *memory, size_t size)
{
    return link_in(realloc(unlinked(memory), sizeof(Block) + size));
}

void fuzz_free(void *memory) { free(unlinked(memory)); }

void fuzz_exit(int status)
{
    (void)status;
    longjmp(start, 1);
}

FILE *fuzz_open(const char *name, const char *mode)
{
    static char ply[] = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    static char obj[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    static char serialized[] = "\x1c\x04\x04\0\x78\x01\x01\x45\0\xba\xff\0\x10\0\0\0\3\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0"
                               "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0"
                               "\0\0\0\0\1\0\0\0\2\0\0\0\x2b\xdb\x01\x96";
    static char xml[] = "<scene version=\"0.6.0\"><bsdf type=\"diffuse\" id=\"inner\"/></scene>";
    const char *dot = strrchr(name, '.');
    if (!strcmp(name, "scene.xml"))
        return opened = fmemopen((void *)(uintptr_t)input, input_size, mode);
    if (dot && !strcmp(dot, ".ply"))
        return opened = fmemopen(ply, sizeof ply - 1, mode);
    if (dot && !strcmp(dot, ".serialized"))
        return opened = fmemopen(serialized, sizeof serialized - 1, mode);
    if (dot && !strcmp(dot, ".xml"))
        return opened = fmemopen(xml, sizeof xml - 1, mode);
    if (dot && !strcmp(dot, ".obj"))
        return opened = fmemopen(obj, sizeof obj - 1, mode);
    errno = ENOENT;
    return NULL;
}

int fuzz_close(FILE *stream)
{
    opened = NULL;
    return fclose(stream);
}

XML_Parser fuzz_parser(const XML_Char *encoding)
{
    static const XML_Memory_Handling_Suite memory = {fuzz_malloc, fuzz_realloc, fuzz_free};
    return XML_ParserCreate_MM(encoding, &memory, NULL);
}

void fuzz_run(void (*read)(const uint8_t *bytes, size_t size), const uint8_t *bytes, size_t size)
{
    if (!fuzz_messages)
        fuzz_messages = fopen("/dev/null", "w");
    input = bytes;
    input_size = size;
    if (setjmp(start) == 0)
        read(bytes, size);
    if (opened)
        fuzz_close(opened);
    while (ring.in.next != &ring)
        fuzz_free(ring.in.next + 1);
}

// SPDX-License-Identifier: BSL-1.0
#ifndef CLES_PLUGIN_ABI_H
#define CLES_PLUGIN_ABI_H

/*
 * What crosses between `clesd` and a plugin (paper, sections 3.5 and 3.6): plain C, so that a plugin may be written in
 * any language that speaks it, and built with another compiler, standard library or Boost than the daemon. In C++,
 * <cles/plugin.hpp> writes all of this for you; docs/plugins.md is the tour.
 *
 * A plugin is a shared library with one entry point, `cles_plugin_v1`. The host loads the library, calls the entry for
 * a description, and calls `start` there, in which the plugin adds its tasks. From then on requests for these tasks
 * come to their `start`, each with the handle of a job, by which the plugin answers.
 *
 * Rules that hold for everything here:
 *
 * - Text is UTF-8, a pointer and a length, not ended by a zero. JSON is text that holds one value. What is handed to a
 *   function is borrowed until that function returns; to keep it, copy it. That holds both ways.
 * - Functions of the host may be called from any thread, but for `add_task`, which is for `start` alone, and `refuse`
 * and `refuse_setting`, which are for `start` and `check`. The host and its functions stay valid until the process
 * ends, and so does the loaded library.
 * - A handle of a job that has been answered, or never was, is harmless: the call does nothing and is counted.
 * - No exception may leave a function of the plugin. (One that does is caught where the compilers allow it.)
 * - A structure begins with its size as its writer knows it, so that later versions append members: read none
 *   past that size. `abi_major` changes when that does not do, and the entry point's name with it.
 */

// NOLINTBEGIN(modernize-deprecated-headers,modernize-redundant-void-arg,modernize-use-using): it is C
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CLES_PLUGIN_ABI_MAJOR 1u
#define CLES_PLUGIN_ABI_MINOR 1u
/* The name of the entry point, as text. */
#define CLES_PLUGIN_ENTRY "cles_plugin_v1"

#if defined(_WIN32)
#define CLES_PLUGIN_EXPORT __declspec(dllexport)
#else
#define CLES_PLUGIN_EXPORT __attribute__((visibility("default")))
#endif

typedef struct cles_text {
    const char* data; /* may be null where size is 0 */
    size_t size;      /* bytes */
} cles_text;

/* The five verbs. */
#define CLES_PULL 0u
#define CLES_PUSH 1u
#define CLES_DELEGATE 2u
#define CLES_BIND 3u
#define CLES_UPDATE 4u

#define CLES_LOG_DEBUG 0u
#define CLES_LOG_INFO 1u
#define CLES_LOG_WARNING 2u
#define CLES_LOG_ERROR 3u

/* A request that is being worked on. Never 0, and not used again while the process lives. */
typedef uint64_t cles_job;

/* What is asked; borrowed until the task's `start` returns. */
typedef struct cles_request {
    uint32_t size; /* of this structure */
    uint32_t verb;
    cles_text node; /* the node that serves it */
    cles_text task;
    const cles_text* parameters; /* after the task, percent-decoded */
    size_t parameter_count;
    cles_text body;           /* JSON, checked; {} where none came */
    int64_t left_ns;          /* until the requester stops waiting, from now on; 0 where that is not known */
    cles_text peer_transport; /* who asks: "tcp", "udp", "unix", "inproc" ... */
    cles_text peer_address;   /* as a URL */
    cles_text peer_name;      /* the node's proven name; empty where the transport proves none */
    int64_t peer_uid;         /* of the process, where the kernel tells; otherwise -1 */
    int32_t peer_local;       /* 1: on this host */
    int32_t reserved;
} cles_request;

/* It may run twice without harm, so that a node that was lost meanwhile is replaced by another. */
#define CLES_TASK_IDEMPOTENT 1u
/* So quick that it runs on the I/O thread, which the host watches. */
#define CLES_TASK_INLINE_OK 2u

/* A task as the plugin adds it. The host copies it. */
typedef struct cles_task {
    uint32_t size; /* of this structure */
    uint32_t verb;
    cles_text name;              /* 1 to 64 letters, digits, '_', '-', '.' */
    cles_text description;       /* for `cles info`; may be empty */
    const cles_text* parameters; /* their names, in order */
    size_t parameter_count;
    uint32_t flags; /* CLES_TASK_... */
    uint32_t reserved;
    /*
     * Called for each request, from several threads at once. It answers the job with `done` or `fail`, now or later,
     * from any thread, once. A handler that computes may do so right here: unless the task is CLES_TASK_INLINE_OK it
     * has a worker of the host's pool for itself. For CLES_BIND it answers `done` with anything where the binding is
     * welcome, and otherwise `fail`; null there opens the task for all bindings.
     */
    void (*start)(void* user, cles_job job, const cles_request* request);
    void* user; /* handed to `start` */
} cles_task;

/* What `add_task` returns. */
#define CLES_ADDED 0
#define CLES_BAD_TASK 1    /* its name, verb, flags or size */
#define CLES_TASK_EXISTS 2 /* this verb and name has a handler, of this plugin or of another */
#define CLES_TOO_LATE 3    /* `start` has ended */

/* Something to be called later. */
typedef struct cles_callback {
    void (*call)(void* user); /* once, or never */
    void (*drop)(void* user); /* exactly once, last: `user` is not used any more. May be null */
    void* user;
} cles_callback;

/* How a job asks others. */
typedef struct cles_ask {
    uint32_t size;       /* of this structure */
    uint32_t urgent;     /* 1: it must not wait behind large ones */
    int64_t deadline_ms; /* 0, and at most: what is left of the job's own */
    cles_text at;        /* a link's URL, instead of asking the directory; may be empty */
    /*
     * Called once, from a thread of the host, and never before `delegate` returns: also where the job was withdrawn
     * meanwhile ("cancelled") or the node stops ("unavailable", also after the plugin's `stop`). The job's own code
     * alone can keep it from being called: it comes after `start` of its job, and after callbacks that came first, once
     * these have returned. `code` is empty on success; otherwise the error's name on the wire ("busy", "deadline",
     * "no_task" ...), `json` is {} then, and `message` the peer's own words.
     */
    void (*answered)(void* user, cles_text code, cles_text json, cles_text message);
    /* Null, or called for each report of a DELEGATE's progress before it is answered: a fraction from 0 to 1. */
    void (*progress)(void* user, double fraction, cles_text json);
    void* user;
} cles_ask;

/* What the host offers a plugin. Each plugin gets one of its own, and hands it back as the first argument. */
typedef struct cles_host {
    uint32_t size; /* of this structure */
    uint32_t abi_minor;
    cles_text node; /* this node's name */

    /* Adds a task: CLES_ADDED, or why not. The plugin may do without it; where `start` fails then, the host tells why.
     */
    int32_t (*add_task)(const struct cles_host* host, const cles_task* task);
    /* Says why `start`, or `check`, is about to fail. */
    void (*refuse)(const struct cles_host* host, cles_text why);

    /* Publishes an update of "task" or "task/parameter/...", to all that are bound. Never blocks; where updates come
     * faster than they can be sent, the oldest go. */
    void (*publish)(const struct cles_host* host, cles_text noun, cles_text json);
    void (*log)(const struct cles_host* host, uint32_t level, cles_text text);

    /* Answers a job: with JSON (empty: {}), or with an error's name on the wire and words for the requester. */
    void (*done)(const struct cles_host* host, cles_job job, cles_text json);
    void (*fail)(const struct cles_host* host, cles_job job, cles_text code, cles_text message);
    /* Answers a job whose work was not begun: "busy", with words, and in how many milliseconds it is worth asking
     * again. What was asked of `any:` is then asked of another node. */
    void (*busy)(const struct cles_host* host, cles_job job, cles_text message, uint32_t retry_ms);
    /* Reports how far the work is, from 0 to 1, with an object (empty: {}). 0 where nobody waits for it any more. */
    int32_t (*progress)(const struct cles_host* host, cles_job job, double fraction, cles_text json);
    /* 1 where nobody waits for the answer any more: it was withdrawn, its link was lost, its time ran out, or the
     * answer has been given. A job that finds itself stopped should end soon; it may answer, or `fail` with
     * "cancelled". */
    int32_t (*stopped)(const struct cles_host* host, cles_job job);
    /* Has the callback called when nobody waits any more, unless the job was answered before; at once where that has
     * happened. One for each job: the last one counts. */
    void (*on_stop)(const struct cles_host* host, cles_job job, const cles_callback* callback);
    /* Sends a request, "PULL car0:speed" or "DELEGATE any:route {...}", on behalf of a job. No worker waits meanwhile:
     * return from `start`, and go on in `answered`. It is withdrawn when the job is. */
    void (*delegate)(const struct cles_host* host, cles_job job, cles_text command, const cles_ask* ask);
    /* A line for the log that belongs to this job. */
    void (*job_log)(const struct cles_host* host, cles_job job, uint32_t level, cles_text text);

    /* Since 1.1; a plugin that may meet an older host looks at `size`. */
    /* Says why `start`, or `check`, is about to fail: for this setting, as "limit" or "cameras[2].rate" (empty: for all
     * of them together). The host tells in which line it stands. */
    void (*refuse_setting)(const struct cles_host* host, cles_text key, cles_text why);
} cles_host;

/* What the entry point returns: a structure that stays valid. */
typedef struct cles_plugin {
    uint32_t size; /* of this structure */
    uint32_t abi_major;
    uint32_t abi_minor; /* what the plugin needs: a host with a lower one refuses it */
    uint32_t reserved;
    cles_text name;
    cles_text version;
    /*
     * Adds the plugin's tasks. `config` is what the daemon's configuration says of this plugin, as a JSON object; {}
     * where it says nothing. 0; or not 0, after `refuse`, and then none of its tasks are served.
     */
    int32_t (*start)(const cles_host* host, cles_text config);
    /*
     * No further job is started from now on; some may still run, and may still answer. To be left soon: what the
     * plugin holds (threads, files, devices) is let go of here. May be null. Not called where `start` failed.
     */
    void (*stop)(void);

    /* Since 1.1. */
    /*
     * Looks whether `start` could do with this configuration, and does nothing else: it opens nothing and adds no task.
     * 0; or not 0, after `refuse_setting` or `refuse`. May be null. Called in a process of its own, before `start` and
     * by `clesd --check`; of the host's functions it may call those two and `log`.
     */
    int32_t (*check)(const cles_host* host, cles_text config);
} cles_plugin;

/* The entry point. It is called once. */
CLES_PLUGIN_EXPORT const cles_plugin* cles_plugin_v1(void);

#ifdef __cplusplus
}
#endif
// NOLINTEND(modernize-deprecated-headers,modernize-redundant-void-arg,modernize-use-using)

#endif

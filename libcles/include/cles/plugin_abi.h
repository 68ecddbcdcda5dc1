// SPDX-License-Identifier: BSL-1.0
#ifndef CLES_PLUGIN_ABI_H
#define CLES_PLUGIN_ABI_H

/*
 * The interface between `clesd` and a plugin (paper, sections 3.5 and 3.6). It is plain C, so that a plugin may be
 * written in any language that can call C, and built with another compiler, standard library or Boost than the daemon.
 * In C++, <cles/plugin.hpp> implements all of it; docs/plugins.md is the introduction.
 *
 * A plugin is a shared library with one entry point, `cles_plugin_v1`. The host loads the library, calls the entry
 * point to get a description, and calls `start` of the description, in which the plugin adds its tasks. From then on,
 * the host calls `start` of a task for each request to it, with the handle of a job, with which the plugin replies.
 *
 * Rules for everything in this file:
 *
 * - Text is UTF-8, a pointer and a length, without a terminating zero. JSON is text that contains one value. What is
 *   passed to a function, in either direction, is borrowed until that function returns; to keep it, copy it.
 * - Functions of the host may be called from any thread, except `add_task`, which may only be called in `start`, and
 *   `refuse` and `refuse_setting`, which may only be called in `start` and `check`. The host and its functions stay
 *   valid until the process ends, and so does the loaded library.
 * - The handle of a job that has been answered, or that never existed, does no harm: the call does nothing and is
 *   counted. Nor does that of a feed that has ended.
 * - The code of a job runs in turns: first `start` of its task, then its callbacks of `cles_ask` and `cles_next`, each
 *   after the one before has returned. Only its callback for `on_stop` may run beside them. This holds after the job's
 *   answer and after a feed's end, too. Exceptions: for what a thread of the plugin or another job asks then, the
 *   callback comes as soon as the host has a thread for it; and a job that asks from each callback for the next event
 *   of a feed that has ended gets the later ones on another thread.
 * - No exception may leave a function of the plugin. (The host catches one if the compilers allow it.)
 * - A structure begins with its size as its writer knows it, so that later versions can append members: read none
 *   beyond that size. A change that is not possible in this way changes `abi_major` and the name of the entry point.
 */

// NOLINTBEGIN(modernize-deprecated-headers,modernize-redundant-void-arg,modernize-use-using): it is C
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CLES_PLUGIN_ABI_MAJOR 1u
#define CLES_PLUGIN_ABI_MINOR 7u
/* The name of the entry point, as text. */
#define CLES_PLUGIN_ENTRY "cles_plugin_v1"

#if defined(_WIN32)
#define CLES_PLUGIN_EXPORT __declspec(dllexport)
#else
#define CLES_PLUGIN_EXPORT __attribute__((visibility("default")))
#endif

typedef struct cles_text {
    const char* data; /* may be null if size is 0 */
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

/* A request that is being served. Never 0, and not reused while the process runs. */
typedef uint64_t cles_job;

/* A request; borrowed until the task's `start` returns. */
typedef struct cles_request {
    uint32_t size; /* of this structure */
    uint32_t verb;
    cles_text node; /* the node that serves it */
    cles_text task;
    const cles_text* parameters; /* after the task, percent-decoded */
    size_t parameter_count;
    cles_text body;  /* valid JSON; {} if there is none */
    int64_t left_ns; /* time until the requester stops waiting; 0 if not known */
    /* The other end of the link on which the request has arrived. If another node has forwarded it, that is this node,
     * not the requester. */
    cles_text peer_transport; /* the scheme of its URL, such as "tcp"; or "multicast" */
    cles_text peer_address;   /* as a URL */
    cles_text peer_name;      /* the node's authenticated name; empty if there is none */
    int64_t peer_uid;         /* of the process, if the kernel reports it; otherwise -1 */
    int32_t peer_local;       /* 1: on this host */
    int32_t reserved;
    /* Since 1.4: the trace that the request belongs to, as a W3C traceparent; empty if there is none. Requests that the
     * job sends with `delegate` belong to it, too. */
    cles_text trace;
    /* Since 1.5; a plugin that also supports older hosts checks `size`. In a secured fleet, the member whose request it
     * is; empty without security. */
    cles_text requester;
    /* The member that has forwarded it for the requester; empty if the requester itself is the peer. */
    cles_text forwarded_by;
} cles_request;

/* The task may run twice without harm, so that another node can replace one that was lost meanwhile. */
#define CLES_TASK_IDEMPOTENT 1u
/* The task is quick enough to run on the I/O thread; the host measures its time. */
#define CLES_TASK_INLINE_OK 2u
/* Since 1.2: requests of the task, except CLES_BIND, run only with the signature of a member of the fleet, and updates
 * of its nouns are signed. An older host ignores this: a plugin that adds such a task checks the host's `abi_minor`. */
#define CLES_TASK_SIGNED 4u

/* Since 1.3: the task's jobs are not moved to other nodes. An older host ignores this, and moves none. */
#define CLES_TASK_LOCAL 8u

/* A task that the plugin adds. The host copies it. */
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
     * Called for each request, from several threads at once. It replies to the job with `done`, `fail` or `busy`, now
     * or later, from any thread, once. It may compute inside this call: unless the task is CLES_TASK_INLINE_OK, the
     * call runs on a worker of the host's pool. For CLES_BIND, it replies with `done` and any JSON to accept the
     * binding, otherwise with `fail`; null accepts all bindings.
     */
    void (*start)(void* user, cles_job job, const cles_request* request);
    void* user; /* passed to `start` */
    /* Since 1.6: what the task tells about its types, a JSON object with the members `parameters`, `body`, `result` and
     * `updates` as far as they are known, each a JSON Schema (docs/protocol.md, "Types"); may be empty. An older host
     * ignores it. */
    cles_text types;
} cles_task;

/* What `add_task` returns. */
#define CLES_ADDED 0
#define CLES_BAD_TASK 1    /* its name, verb, flags, types or size */
#define CLES_TASK_EXISTS 2 /* this verb and name already has a handler, of this plugin or another */
#define CLES_TOO_LATE 3    /* `start` has ended */

/* A function to be called later. */
typedef struct cles_callback {
    void (*call)(void* user); /* once, or never */
    void (*drop)(void* user); /* exactly once, as the last call with `user`. May be null */
    void* user;
} cles_callback;

/* For `hops`: the request is not forwarded. */
#define CLES_NO_HOPS UINT32_MAX

/* Options and callbacks of a request that a job sends. */
typedef struct cles_ask {
    uint32_t size;       /* of this structure */
    uint32_t urgent;     /* 1: it must not wait behind large requests */
    int64_t deadline_ms; /* at most the job's remaining time; 0: all of it */
    cles_text at;        /* the URL to send it to, instead of looking up the name; may be empty */
    /*
     * Called once, on a thread of the host, and never inside `delegate`; also if the job was cancelled meanwhile
     * ("cancelled"), or the node stops ("unavailable", also after the plugin's `stop`). It is called after `start` of
     * the job and all earlier callbacks of the job have returned, so only the job's own code can delay it. `code` is
     * empty on success. Otherwise it is the error's name on the wire ("busy", "deadline", "no_task" ...), `json` is {},
     * and `message` is the peer's message.
     */
    void (*answered)(void* user, cles_text code, cles_text json, cles_text message);
    /* Null, or called for each report of a DELEGATE's progress before it is answered: a fraction from 0 to 1. */
    void (*progress)(void* user, double fraction, cles_text json);
    void* user;
    /* Since 1.7; an older host ignores it. How many nodes may forward the request, 16 at most. 0: 8. */
    uint32_t hops;
    uint32_t reserved;
} cles_ask;

/* Since 1.7: a feed of a job. Never 0, and not reused while the process runs. */
typedef uint64_t cles_feed;

/* The kinds of events of a feed. */
#define CLES_FEED_CURRENT 0u /* the publisher's last value when the binding was made */
#define CLES_FEED_UPDATE 1u
#define CLES_FEED_GAP 2u     /* `missed` updates were not received */
#define CLES_FEED_LOST 3u    /* the publisher was lost, for the reason in `text`; the host binds again by itself */
#define CLES_FEED_REBOUND 4u /* the publisher is back */

/* An event of a feed; borrowed until the callback returns. */
typedef struct cles_event {
    uint32_t size; /* of this structure */
    uint32_t kind;
    cles_text json;      /* of CURRENT and UPDATE: valid JSON, an object or an array; otherwise {} */
    cles_text publisher; /* the publishing node's name; empty if not known */
    uint64_t seq;        /* of UPDATE, and of CURRENT with `cles_bind.mark`: its sequence number; 0 if not known */
    uint64_t missed;     /* of GAP */
    cles_text text;      /* of LOST */
    int64_t waited_ns;   /* for a worker, since the job could have had it */
    uint32_t epoch;      /* of what has a `seq`: that of the publisher's run, in which it counts */
    uint32_t reserved;
} cles_event;

/* How a job binds. */
typedef struct cles_bind {
    uint32_t size; /* of this structure */
    /* How many updates wait, at the publisher while the link is slow, and at this node until the job asks for them.
     * Beyond that, the oldest are dropped, and told as a gap. 0: 64; 65536 at most. */
    uint32_t keep;
    int64_t every_ms;    /* the minimum interval between updates; the newest is sent. 0: every update */
    int64_t deadline_ms; /* for the publisher's reply; 0: 5 s */
    cles_text at;        /* the URL to send it to, instead of looking up the name; may be empty */
    uint32_t hops;       /* how many nodes may forward it, 16 at most. 0: 8 */
    uint32_t mark;       /* 1: CURRENT tells which update it is, if the publisher knows: `seq` and `epoch` */
} cles_bind;

/* Receives the next event of a feed. */
typedef struct cles_next {
    uint32_t size; /* of this structure */
    uint32_t reserved;
    /*
     * Called once, on a thread of the host, and never inside `next`, but in a turn of the job: after `start` and all
     * its earlier callbacks have returned. `code` is empty if there is an event. Otherwise the feed has ended, `event`
     * is null, and `code` is the error's name on the wire, with a message: the publisher's, or "cancelled" after
     * `unbind` and the end of the job.
     */
    void (*event)(void* user, cles_text code, cles_text message, const cles_event* event);
    void* user;
} cles_next;

/* The functions of the host. Each plugin gets its own structure, and passes it back as the first argument. */
typedef struct cles_host {
    uint32_t size; /* of this structure */
    uint32_t abi_minor;
    cles_text node; /* this node's name */

    /* Adds a task. Returns CLES_ADDED, or the reason for the failure. The plugin may continue without the task; if its
     * `start` fails, the host reports that reason. */
    int32_t (*add_task)(const struct cles_host* host, const cles_task* task);
    /* Gives the reason why `start` or `check` is about to fail. */
    void (*refuse)(const struct cles_host* host, cles_text why);

    /* Publishes an update of "task" or "task/parameter/..." to all subscribers. Never blocks; if updates are published
     * faster than they can be sent, the oldest are dropped. */
    void (*publish)(const struct cles_host* host, cles_text noun, cles_text json);
    void (*log)(const struct cles_host* host, uint32_t level, cles_text text);

    /* Replies to a job: with JSON (empty: {}), or with an error's name on the wire and a message. */
    void (*done)(const struct cles_host* host, cles_job job, cles_text json);
    void (*fail)(const struct cles_host* host, cles_job job, cles_text code, cles_text message);
    /* Replies "busy" to a job that was not started, with a message, and the number of milliseconds after which a retry
     * makes sense. A request to `any:` then goes to another node. */
    void (*busy)(const struct cles_host* host, cles_job job, cles_text message, uint32_t retry_ms);
    /* Reports progress from 0 to 1, with a JSON object (empty: {}). Returns 0 if nobody waits for it any more. */
    int32_t (*progress)(const struct cles_host* host, cles_job job, double fraction, cles_text json);
    /* Returns 1 if nobody waits for the reply any more: the job was cancelled, its link was lost, its deadline passed,
     * or it has been answered. A stopped job should end soon; it may reply, or `fail` with "cancelled". */
    int32_t (*stopped)(const struct cles_host* host, cles_job job);
    /* Sets a callback that is called when nobody waits any more, unless the job was answered before that; at once if
     * that has already happened. A job has one callback: the last one that was set. */
    void (*on_stop)(const struct cles_host* host, cles_job job, const cles_callback* callback);
    /* Sends a request, "PULL car0:speed" or "DELEGATE any:route {...}", on behalf of a job. No worker waits for the
     * reply: return from `start`, and continue in `answered`. The request is cancelled when the job is. */
    void (*delegate)(const struct cles_host* host, cles_job job, cles_text command, const cles_ask* ask);
    /* Writes a line about this job to the log. */
    void (*job_log)(const struct cles_host* host, cles_job job, uint32_t level, cles_text text);

    /* Since 1.1; a plugin that also supports older hosts checks `size`. */
    /* Gives the reason why `start` or `check` is about to fail, and the setting that causes it, such as "limit" or
     * "cameras[2].rate" (empty: the settings as a whole). The host reports the line of the setting. */
    void (*refuse_setting)(const struct cles_host* host, cles_text key, cles_text why);

    /* Since 1.7. */
    /* Binds a noun, such as "car0:speed", on behalf of a job, with the rights of this node. Whether that succeeds,
     * `next` tells. The feed ends with the job. It has to be unbound, unless `next` has told that it has ended. A job
     * has 64 feeds at most; those of a task that is CLES_TASK_INLINE_OK have none. */
    cles_feed (*bind)(const struct cles_host* host, cles_job job, cles_text noun, const cles_bind* how);
    /* Asks for the next event. No worker waits for it: return, and continue in the callback. Nothing is delivered that
     * has not been asked for; what comes meanwhile waits (`cles_bind.keep`). One call at a time for each feed. */
    void (*next)(const struct cles_host* host, cles_feed feed, const cles_next* next);
    /* Ends a feed. A call of `next` that waits gets "cancelled". */
    void (*unbind)(const struct cles_host* host, cles_feed feed);
} cles_host;

/* The result of the entry point; it must stay valid. */
typedef struct cles_plugin {
    uint32_t size; /* of this structure */
    uint32_t abi_major;
    uint32_t abi_minor; /* required by the plugin: a host with a lower one refuses it */
    uint32_t reserved;
    cles_text name;
    cles_text version;
    /*
     * Adds the plugin's tasks. `config` contains the plugin's settings in the daemon's configuration as a JSON object;
     * {} if there are none. Returns 0; or, after `refuse`, another value, and then none of its tasks are served.
     */
    int32_t (*start)(const cles_host* host, cles_text config);
    /*
     * Releases what the plugin holds (threads, files, devices), and returns soon. No further job is started; jobs that
     * still run may still reply. May be null. Not called if `start` failed.
     */
    void (*stop)(void);

    /* Since 1.1. */
    /*
     * Checks whether `start` can use this configuration, and does nothing else: it opens nothing and adds no task.
     * Returns 0; or, after `refuse_setting` or `refuse`, another value. May be null. Called in a separate process,
     * before `start` and by `clesd --check`. Of the host's functions, it may call only these two and `log`.
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

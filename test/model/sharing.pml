// SPDX-License-Identifier: BSL-1.0
//
// Work sharing between two nodes (docs/protocol.md, "Work sharing"): a model in Promela, for spin 6.5.
//
// The holder has a queue of jobs and one worker. The helper has two workers, a job of its own that may arrive at any time,
// and grants the holder its free slots. test/model/check_model.py checks, for every order of events:
//   - no job is run twice, a worker runs one job at a time, jobs of the helper go first, a job is answered once;
//   - no deadlock: even without deadlines, the system only comes to rest when every job has been answered;
//   - with deadlines and under weak fairness, every job is answered (`answered`), and the system comes to rest: no
//     livelock, no message that is sent forever;
//   - every transition of the table below is taken.
//
// Each step of a process is a `d_step`, which is one transition of the search, so it must not contain a choice. Where a step
// can go on in several ways, such as with any of the datagrams in flight, that is chosen first, and then comes the
// `rest_of_step`. A check sees to it that there are as many states if each step may choose.
//
// The table. A statement with a comment "T" is a transition of the state machines that the code implements; the test of
// the code reads the table from here. `holder` is a job at the holder, `helper` a grant at the helper. Statements without
// such a comment belong to the environment: what the network, the workers and the requesters do.
//
// Configurations: define one of
//   STREAM      the link is FIFO. It may break at any time: what is sent from then on is lost, and what is in flight may be.
//               Each node notices at some later time. When both have, there may be a new link.
//   DATAGRAM    messages are lost, delayed and reordered. The holder sends a DELEGATE again until it is answered, and the
//               helper recognises the repetition. With BREAKS, a node may take the other for lost without reason.
// and any of
//   LIVENESS    to check for endless executions: nothing is bound to happen but what the nodes, the workers and the network
//               have to do, and the deadlines; the events of `environment` may end at any time
//   PATIENCE    to check for deadlocks: from any moment on, deadlines may be so far away that they do not help
//   ONE_JOB     one job instead of two
// One node may crash (CRASHES), and one may stop in order (STOPS): the holder at the end of its drain, the helper in two
// steps: it accepts no more, and later it answers what it has begun and leaves. A helper that has crashed may start again,
// without any memory of before.
//
// What is abstracted:
//   - Time. Whatever has a time limit may happen at any moment from the beginning: the deadline of a job, the 50 ms of a
//     grant, the detection of a loss. Nothing is assumed about how long anything takes, so a node that is suspended is one
//     that is slow. Two bounds are assumed: a grant is sent once, because its deadline (50 ms) is shorter than the first
//     retransmission (200 ms); and the copies of a request have left the network before the helper forgets its reply (60 s).
//   - Withdrawal: a cancellation, the deadline and the loss of the requester have the same effect here. The link between
//     requester and holder is reliable until then.
//   - Which jobs move: any of those that wait, in any combination. The estimates of the code choose among these.
//   - Queues: job 0 is in front of job 1, and both wait from the start. The helper's own job takes a free worker at once.
//     Handlers end, though not at once when they are told to.
//   - A report of waiting jobs is not a message: the helper may learn of them at any time, and act on it at any later time.
//   - Grants are random numbers that never repeat. Here they are GRANTS numbers, each used again when no message and no
//     node refers to it any longer. A helper knows all grants that it has given since it started.
//   - A grant that is replaced is one that expires just before the next is offered. The holder may keep a grant for as long
//     as it likes: the helper decides whether it is still valid.
//   - A copy that the network makes is the same as one that is sent again. Replies to cancellations, progress, access
//     rights, memory limits, and a third node are left out. That a node may be holder and helper at once is left out too:
//     that concerns different jobs, because a job moves once.
//
// Broken variants, each of which the checks must refute:
//   RERUN_LOST         a job returns to the queue if the link or the node is lost after the job was sent
//   BUSY_WHEN_BEGUN    a helper that stops answers the jobs that it has begun as if it had not begun them
//   FAILURE_REFUSES    a failure that the handler reports is taken for a refusal before it began
//   LATE_GRANT         a job with an expired grant is accepted
//   NO_OWN_FIRST       a job with a valid grant is accepted even if the own job has taken the worker
//   LOSS_UNNOTICED     the loss of a link ends no job that was sent: only its deadline does
//   NO_DEDUP           the helper does not recognise repeated datagrams
//   TRUST_UNKNOWN      by datagram, the refusal of a helper that does not know the grant is taken for "not begun": it may
//                      have started again after it began the job
//   NO_DEADLINE        deadlines do not pass

#ifndef rest_of_step
#define rest_of_step d_step
#endif
#ifdef STREAM
#define FIFO
#elif !defined(DATAGRAM)
#error "define STREAM or DATAGRAM"
#endif

#define JOBS 2
#define WORKERS 2 // of the helper, and so the most slots of a grant
#define GRANTS 2
#ifndef BREAKS
#define BREAKS 1
#endif
#ifndef CRASHES
#define CRASHES 1
#endif
#ifndef STOPS
#define STOPS 1
#endif
#define NONE 7

// --- Messages ----------------------------------------------------------------------------------------------------------

// To the helper.
#define DELEGATE(j, g) ((j) * GRANTS + (g))      // the pair is the id of the request
#define CANCEL(j) (JOBS * GRANTS + (j))          // PUSH cles/cancel
#define TAKEN(g) (JOBS * GRANTS + JOBS + (g))    // the reply to a grant
// To the holder.
#define GRANT(g, n) ((g) * WORKERS + (n) - 1)    // PUSH cles/slots with grant: for n jobs
#define REPLY(j, g, k) (GRANTS * WORKERS + ((j) * GRANTS + (g)) * 3 + (k))
#define OUTCOME 0                                // k: a result or a failure after the job began
#define BUSY 1                                   // k: refused, not begun; the helper knows the grant
#define UNKNOWN 2                                // k: refused; this helper has not given that grant
#define LEAVING (GRANTS * WORKERS + JOBS * GRANTS * 3) // PUSH cles/leaving, the last line on a stream

#ifdef FIFO
chan to_helper = [6] of { byte };
chan to_holder = [6] of { byte };
#define any_in(net) nempty(net)
#define has(net, m) net??[eval(m)]
#define receive(net, m) net?m
#define clear(net) do :: nempty(net) -> net?_ :: empty(net) -> break od
// Nothing reaches the other node after the break.
#define send(net, m) if :: !broken -> assert(nfull(net)); net!m :: broken fi
#else
int to_helper; // the set of datagrams in flight, a bit for each
int to_holder;
#define any_in(net) (net != 0)
#define has(net, m) ((net >> (m)) & 1)
#define receive(net, m) net = net & ~(1 << (m))
#define one_of_four(net, m, first) \
    :: has(net, first) -> m = first \
    :: has(net, first + 1) -> m = first + 1 \
    :: has(net, first + 2) -> m = first + 2 \
    :: has(net, first + 3) -> m = first + 3
#define any_to_helper(m) if one_of_four(to_helper, m, 0) one_of_four(to_helper, m, 4) fi
#define any_to_holder(m) \
    if \
    one_of_four(to_holder, m, 0) one_of_four(to_holder, m, 4) \
    one_of_four(to_holder, m, 8) one_of_four(to_holder, m, 12) \
    fi
#define clear(net) skip
#define send(net, m) net = net | (1 << (m))
#endif

bool broken;             // the link is; by datagram, a node has reason to take the other for lost
bool holder_link = true; // as far as the holder knows
bool helper_link = true;

// --- The nodes ---------------------------------------------------------------------------------------------------------

mtype = { waiting, running, moved, done, none, open, closed, idle, stopping };

// The holder.
bool holder_up = true;
#ifdef ONE_JOB
mtype job[JOBS] = { waiting, done };
#else
mtype job[JOBS] = waiting;
#endif
byte by[JOBS];              // the grant of a job that has moved
bool sent[JOBS];            // its DELEGATE has been written
byte held = NONE;           // the grant that the holder has
byte left;                  // how many jobs it may forward on it
byte at_worker = NONE;      // the job that the worker runs, answered or not

// The helper.
bool helper_up = true;
bool draining;
bool news;                  // jobs wait at the holder
mtype grant[GRANTS] = none;
byte slots;                 // of the open grant
mtype at_helper[JOBS] = idle; // stopping: answered, but the handler has not ended
byte with[JOBS];            // the grant of a job that runs
mtype own = none;           // the helper's own job
#ifndef FIFO
#define FRESH 0
#define BEGUN 1
#define REPLIED 2           // REPLIED + k
byte seen[JOBS * GRANTS];   // the requests that it remembers, and the reply
#endif

byte ran[JOBS];

#define all_done (job[0] == done && job[1] == done)
#define some_wait (holder_up && (job[0] == waiting || job[1] == waiting))
#define is_open(g) (grant[g] == open)
#define some_open (is_open(0) || is_open(1))
#define busy_workers ((own == running) + (at_helper[0] != idle) + (at_helper[1] != idle))
#define is_begun(j, g) (at_helper[j] == running && with[j] == g)
#define is_with(j, g) (job[j] == moved && by[j] == g)

inline begins(j) {
    ran[j]++;
    assert(ran[j] <= 1)
}

// Whether a message or a node refers to the grant.
#define occurs_for(j, g) (has(to_helper, DELEGATE(j, g)) || is_with(j, g) || is_begun(j, g) || \
    has(to_holder, REPLY(j, g, 0)) || has(to_holder, REPLY(j, g, 1)) || has(to_holder, REPLY(j, g, 2)))
#define occurs(g) (occurs_for(0, g) || occurs_for(1, g) || has(to_holder, GRANT(g, 1)) || has(to_holder, GRANT(g, 2)) || \
    has(to_helper, TAKEN(g)) || held == g)

#define forget_grant(g) if :: grant[g] == closed && !occurs(g) -> grant[g] = none :: else fi

#ifdef FIFO
#define forget_messages() skip
#else
// A datagram that would be ignored when it arrives: a reply that nobody waits for, and which reply a repeated request
// would get; the reply to a grant that is not open; the cancellation of a job that is not here, and does not arrive.
#define forget_request(j, g) \
    if \
    :: !is_with(j, g) -> \
        to_holder = to_holder & ~(7 << REPLY(j, g, 0)); \
        if \
        :: !has(to_helper, DELEGATE(j, g)) && !is_begun(j, g) -> seen[(j) * GRANTS + g] = FRESH \
        :: else -> if :: seen[(j) * GRANTS + g] >= REPLIED -> seen[(j) * GRANTS + g] = BEGUN :: else fi \
        fi \
    :: else \
    fi
#define forget_taken(g) if :: !is_open(g) -> to_helper = to_helper & ~(1 << TAKEN(g)) :: else fi
#define forget_cancel(j) \
    if \
    :: at_helper[j] != running && !has(to_helper, DELEGATE(j, 0)) && !has(to_helper, DELEGATE(j, 1)) -> \
        to_helper = to_helper & ~(1 << CANCEL(j)) \
    :: else \
    fi
inline forget_messages() {
    forget_request(0, 0); forget_request(0, 1); forget_request(1, 0); forget_request(1, 1);
    forget_taken(0); forget_taken(1);
    forget_cancel(0); forget_cancel(1)
}
#endif

// What can make no difference any longer is set to one value, so that there are fewer states.
inline tidy() {
    forget_messages();
    forget_grant(0); forget_grant(1)
}

// --- The holder --------------------------------------------------------------------------------------------------------

inline forget_move(j) { by[j] = 0; sent[j] = false }

inline withdraw(j) {
    if
    :: job[j] == waiting -> job[j] = done /* T holder.waiting --withdrawn--> holder.done */
    :: job[j] == running -> job[j] = done /* T holder.running --withdrawn--> holder.done */
    :: job[j] == moved ->
        if :: sent[j] -> send(to_helper, CANCEL(j)) :: else fi;
        job[j] = done; /* T holder.moved --withdrawn--> holder.done */
        forget_move(j)
    fi;
    tidy()
}

// Cancellations, deadlines, requesters that are lost.
active proctype requester() {
    do
    :: all_done -> break
#ifndef NO_DEADLINE
    :: d_step { job[0] != done -> withdraw(0) }
    :: d_step { job[1] != done -> withdraw(1) }
#endif
#ifdef PATIENCE
    :: true -> all_done; break // from here on nobody withdraws: the rest must answer
#endif
    od
}

inline start(j) {
    job[j] = running; /* T holder.waiting --worker_free--> holder.running */
    at_worker = j;
    begins(j)
}

active proctype holder_worker() {
end:
    do
    :: d_step { holder_up && at_worker == NONE && job[0] == waiting -> start(0) }
    :: d_step { holder_up && at_worker == NONE && job[0] != waiting && job[1] == waiting -> start(1) }
    :: d_step {
        at_worker != NONE ->
            if
            :: job[at_worker] == running -> job[at_worker] = done /* T holder.running --answered--> holder.done */
            :: else // withdrawn before
            fi;
            at_worker = NONE
        }
    od
}

inline drop_grant() {
    held = NONE;
    left = 0
}

inline move(j) {
    job[j] = moved; /* T holder.waiting --granted--> holder.moved */
    by[j] = held;
    left--;
    if :: left == 0 -> drop_grant() :: else fi
}

// Keeps the grant, instead of the one before.
inline keep(g, n) {
    held = g;
    left = n;
    send(to_helper, TAKEN(g))
}

inline reply(j, g, k) {
    if
    :: is_with(j, g) && sent[j] ->
        if
        :: k == OUTCOME ->
            job[j] = done /* T holder.moved --answered--> holder.done */
#if defined(FIFO) || defined(TRUST_UNKNOWN)
        :: k != OUTCOME ->
            job[j] = waiting /* T holder.moved --refused--> holder.waiting */
#else
        :: k == BUSY ->
            job[j] = waiting /* T holder.moved --refused--> holder.waiting */
        :: k == UNKNOWN -> // it may be another incarnation of the helper, and the job may have begun in the last
            job[j] = done /* T holder.moved --lost--> holder.done */
#endif
        fi;
        forget_move(j)
    :: else // nobody waits for it
    fi
}

inline write(j) {
    send(to_helper, DELEGATE(j, by[j]));
    sent[j] = true
}

// The link or the node is lost, for this job.
inline lose(j) {
    if
    :: job[j] == moved && !sent[j] ->
        job[j] = waiting; /* T holder.moved --refused--> holder.waiting */
        forget_move(j)
    :: job[j] == moved && sent[j] ->
#if defined(RERUN_LOST)
        job[j] = waiting;
        forget_move(j)
#elif defined(LOSS_UNNOTICED)
        skip
#else
        job[j] = done; /* T holder.moved --lost--> holder.done */
        forget_move(j)
#endif
    :: else
    fi
}

// The helper leaves: what it has not answered on the link has not begun.
inline leave(j) {
    if
    :: job[j] == moved ->
        job[j] = waiting; /* T holder.moved --refused--> holder.waiting */
        forget_move(j)
    :: else
    fi
}

// A message arrives.
inline holder_receives(m) {
    if
    :: m < GRANT(1, 1) -> keep(0, m + 1)
    :: m >= GRANT(1, 1) && m < REPLY(0, 0, 0) -> keep(1, m - GRANT(1, 1) + 1)
    :: m >= REPLY(0, 0, 0) && m < REPLY(0, 1, 0) -> reply(0, 0, m - REPLY(0, 0, 0))
    :: m >= REPLY(0, 1, 0) && m < REPLY(1, 0, 0) -> reply(0, 1, m - REPLY(0, 1, 0))
    :: m >= REPLY(1, 0, 0) && m < REPLY(1, 1, 0) -> reply(1, 0, m - REPLY(1, 0, 0))
    :: m >= REPLY(1, 1, 0) && m < LEAVING -> reply(1, 1, m - REPLY(1, 1, 0))
#ifdef FIFO
    :: m == LEAVING -> holder_link = false; broken = true; leave(0); leave(1); clear(to_holder)
#endif
    fi;
    m = 0;
    tidy()
}

active proctype holder_net() {
    byte m;
end:
    do
#ifdef FIFO
    :: d_step { any_in(to_holder) && holder_link && holder_up -> receive(to_holder, m); holder_receives(m) }
#else
    :: atomic { any_in(to_holder) && holder_link && holder_up ->
            any_to_holder(m);
            rest_of_step { receive(to_holder, m); holder_receives(m) }
        }
#endif
    // Forwards any of the jobs that wait, as far as slots are granted; the grant expires.
    :: d_step { holder_link && held != NONE && job[0] == waiting -> move(0) }
    :: d_step { holder_link && held != NONE && job[1] == waiting -> move(1) }
    :: d_step { held != NONE -> drop_grant(); tidy() }
    :: d_step { holder_link && job[0] == moved && !sent[0] -> write(0) }
    :: d_step { holder_link && job[1] == moved && !sent[1] -> write(1) }
    // The helper learns that jobs wait here.
    :: d_step { holder_link && helper_link && some_wait && !news && !broken -> news = true }
    // The link or the node is lost.
    :: d_step {
        broken && holder_link && holder_up ->
            holder_link = false;
            clear(to_holder);
            lose(0);
            lose(1);
            tidy()
        }
#ifdef FIFO
    // A new link.
    :: d_step {
        broken && !holder_link && !helper_link && holder_up && helper_up ->
            broken = false; holder_link = true; helper_link = true
        }
#else
    // A datagram of the helper arrives after its loss, or instead of it.
    :: d_step { broken && holder_up && helper_up -> broken = false; holder_link = true; helper_link = true }
    // Lost, or nobody is there to receive it.
    :: atomic { any_in(to_holder) -> any_to_holder(m); rest_of_step { receive(to_holder, m); m = 0; tidy() } }
    // Retransmission.
    :: d_step { holder_link && job[0] == moved && sent[0] && !has(to_helper, DELEGATE(0, by[0])) -> write(0) }
    :: d_step { holder_link && job[1] == moved && sent[1] && !has(to_helper, DELEGATE(1, by[1])) -> write(1) }
#endif
    od
}

// --- The helper --------------------------------------------------------------------------------------------------------

#ifdef FIFO
#define remember(j, g, k) skip
#define remember_begun(j, g) skip
#else
#define remember(j, g, k) seen[(j) * GRANTS + g] = REPLIED + k
#define remember_begun(j, g) seen[(j) * GRANTS + g] = BEGUN
#endif
#define answer(j, g, k) send(to_holder, REPLY(j, g, k)); remember(j, g, k)

inline close_grant(g) {
    if :: is_open(g) -> grant[g] = closed /* T helper.open --expired--> helper.closed */ :: else fi
}

inline close_grants() {
    close_grant(0);
    close_grant(1);
    slots = 0
}

inline offer(g) {
    grant[g] = open; /* T helper.none --offered--> helper.open */
    news = false;
    slots = WORKERS - busy_workers;
    send(to_holder, GRANT(g, slots))
}

inline accept(j, g) {
    assert(own != waiting);
    begins(j);
    at_helper[j] = running;
    with[j] = g;
    assert(busy_workers <= WORKERS);
    remember_begun(j, g);
    slots--;
    if
    :: slots > 0 -> grant[g] = open /* T helper.open --used--> helper.open */
    :: else ->
        grant[g] = closed /* T helper.open --used--> helper.closed */
    fi
}

inline delegate(j, g) {
#if !defined(FIFO) && !defined(NO_DEDUP)
    if
    :: seen[(j) * GRANTS + g] == BEGUN // the reply follows
    :: seen[(j) * GRANTS + g] >= REPLIED -> answer(j, g, seen[(j) * GRANTS + g] - REPLIED)
    :: seen[(j) * GRANTS + g] == FRESH ->
        new_delegate(j, g)
    fi
#else
    new_delegate(j, g)
#endif
}

#define is_valid(g) is_open(g)
#define may_begin(g) (own != waiting && busy_workers < WORKERS)
#ifdef NO_OWN_FIRST
#undef may_begin
#define may_begin(g) true
#endif
#ifdef LATE_GRANT
#undef is_valid
#define is_valid(g) (grant[g] != none)
#undef may_begin
#define may_begin(g) (grant[g] == closed || (own != waiting && busy_workers < WORKERS))
#endif

inline new_delegate(j, g) {
    if
    :: is_valid(g) && may_begin(g) -> accept(j, g)
    :: is_valid(g) && !may_begin(g) ->
        grant[g] = open; /* T helper.open --own_job--> helper.open */
        answer(j, g, BUSY)
    :: !is_valid(g) && grant[g] == closed ->
        grant[g] = closed; /* T helper.closed --late--> helper.closed */
        answer(j, g, BUSY)
    :: grant[g] == none -> // no grant of this incarnation: there is none to change
        answer(j, g, UNKNOWN)
    fi
}

// What is not used at once stays valid, but is not reserved: nothing changes for the jobs that come with it.
inline settle(g) {
    if :: is_open(g) -> grant[g] = open /* T helper.open --taken--> helper.open */ :: else fi
}

// The job is answered while its handler still runs: it was cancelled, or its deadline has passed.
inline withdraw_here(j) {
    if :: at_helper[j] == running -> answer(j, with[j], OUTCOME); at_helper[j] = stopping; with[j] = 0 :: else fi
}

// The holder is lost: its jobs are cancelled, and nobody is told.
inline lose_here(j) {
    if :: at_helper[j] == running -> remember(j, with[j], OUTCOME); at_helper[j] = stopping; with[j] = 0 :: else fi
}

#define may_offer (helper_link && news && !draining && !some_open && own != waiting && busy_workers < WORKERS)
#define is_free(g) (grant[g] == none && !occurs(g))

// A message arrives.
inline helper_receives(m) {
    if
    :: m == DELEGATE(0, 0) -> delegate(0, 0)
    :: m == DELEGATE(0, 1) -> delegate(0, 1)
    :: m == DELEGATE(1, 0) -> delegate(1, 0)
    :: m == DELEGATE(1, 1) -> delegate(1, 1)
    :: m == CANCEL(0) -> withdraw_here(0)
    :: m == CANCEL(1) -> withdraw_here(1)
    :: m == TAKEN(0) -> settle(0)
    :: m == TAKEN(1) -> settle(1)
    fi;
    m = 0;
    tidy()
}

active proctype helper_net() {
    byte m;
end:
    do
#ifdef FIFO
    :: d_step { any_in(to_helper) && helper_link && helper_up -> receive(to_helper, m); helper_receives(m) }
#else
    :: atomic { any_in(to_helper) && helper_link && helper_up ->
            any_to_helper(m);
            rest_of_step { receive(to_helper, m); helper_receives(m) }
        }
#endif
    :: d_step { may_offer && is_free(0) -> offer(0) }
    :: d_step { may_offer && !is_free(0) && is_free(1) -> offer(1) }
    :: d_step { some_open -> close_grants(); tidy() }
    :: d_step {
        broken && helper_link && helper_up ->
            helper_link = false;
            news = false;
            clear(to_helper);
            close_grants();
            lose_here(0);
            lose_here(1);
            tidy()
        }
#ifndef FIFO
    :: atomic { any_in(to_helper) -> any_to_helper(m); rest_of_step { receive(to_helper, m); m = 0; tidy() } }
#endif
    od
}

inline serve_own() {
    if :: own == waiting && busy_workers < WORKERS -> own = running :: else fi
}

inline finish(j, k) {
    if
    :: at_helper[j] == running -> answer(j, with[j], k)
    :: else
    fi;
    at_helper[j] = idle;
    with[j] = 0;
    serve_own();
    tidy()
}

active proctype helper_worker() {
end:
    do
    :: d_step { own == running -> own = done }
    :: d_step { at_helper[0] != idle -> finish(0, OUTCOME) }
    :: d_step { at_helper[1] != idle -> finish(1, OUTCOME) }
#ifdef FAILURE_REFUSES
    :: d_step { at_helper[0] == running -> finish(0, BUSY) }
    :: d_step { at_helper[1] == running -> finish(1, BUSY) }
#endif
    // The deadline of the job passes here.
    :: d_step { at_helper[0] == running -> withdraw_here(0); tidy() }
    :: d_step { at_helper[1] == running -> withdraw_here(1); tidy() }
    od
}

// --- The environment ---------------------------------------------------------------------------------------------------

// The holder's drain ends.
inline stop(j) {
    if
    :: job[j] == waiting -> job[j] = done /* T holder.waiting --stopped--> holder.done */
    :: job[j] == running -> job[j] = done /* T holder.running --stopped--> holder.done */
    :: job[j] == moved ->
        if :: sent[j] -> send(to_helper, CANCEL(j)) :: else fi;
        job[j] = done; /* T holder.moved --stopped--> holder.done */
        forget_move(j)
    :: else
    fi
}

inline holder_ends() {
    holder_up = false;
    drop_grant();
    at_worker = NONE;
    holder_link = false;
    broken = true;
    clear(to_holder)
}

// The drain of the helper ends: what still runs is answered.
inline stop_here(j) {
#ifdef BUSY_WHEN_BEGUN
    if :: at_helper[j] == running -> answer(j, with[j], BUSY) :: else fi
#else
    if :: at_helper[j] == running -> answer(j, with[j], OUTCOME) :: else fi
#endif
}

inline helper_ends() {
    helper_up = false;
    helper_link = false;
    broken = true;
    news = false;
    at_helper[0] = idle; at_helper[1] = idle;
    with[0] = 0; with[1] = 0;
    if :: own != none -> own = done :: else fi;
    grant[0] = none; grant[1] = none;
    slots = 0;
#ifndef FIFO
    seen[0] = FRESH; seen[1] = FRESH; seen[2] = FRESH; seen[3] = FRESH;
#endif
    clear(to_helper)
}

active proctype environment() {
    byte breaks = BREAKS, crashes = CRASHES, stops = STOPS;
end:
    do
    :: d_step { own == none && helper_up -> own = waiting; serve_own() }
    :: d_step { breaks > 0 && !broken -> breaks--; broken = true }
    // Whoever waits for a job at the holder learns of its loss, and takes it for answered.
    :: d_step { crashes > 0 && holder_up && !all_done ->
            crashes--;
            job[0] = done; job[1] = done;
            forget_move(0); forget_move(1);
            holder_ends();
            tidy()
        }
    :: d_step { crashes > 0 && helper_up -> crashes--; helper_ends(); tidy() }
    :: d_step { !helper_up && !draining -> helper_up = true }
    :: d_step { stops > 0 && holder_up && !all_done ->
            stops--;
            stop(0);
            stop(1);
            holder_ends();
            tidy()
        }
    :: d_step { stops > 0 && helper_up && !draining -> stops--; draining = true; close_grants(); tidy() }
    :: d_step { draining && helper_up ->
            stop_here(0);
            stop_here(1);
#ifdef FIFO
            send(to_holder, LEAVING);
#endif
            helper_ends();
            tidy()
        }
#ifdef LIVENESS
    :: break
#endif
    od
}

ltl answered { <> all_done }

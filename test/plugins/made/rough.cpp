// SPDX-License-Identifier: BSL-1.0
// A plugin whose jobs violate the rules, written against the bare C entry point.
#include <cles/plugin_abi.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

const cles_host* the_host = nullptr;

cles_text text(const char* words) { return {words, std::strlen(words)}; }
std::string string(cles_text from) { return {from.data, from.size}; }

void twice(void*, cles_job job, const cles_request*) {
    the_host->done(the_host, job, text("1"));
    the_host->done(the_host, job, text("2"));
    the_host->fail(the_host, job, text("failed"), text("3"));
}

void twice_elsewhere(void*, cles_job job, const cles_request*) {
    std::thread{[job] {
        the_host->done(the_host, job, text("1"));
        the_host->done(the_host, job, text("2"));
    }}.join();
    the_host->done(the_host, job, text("3"));
}

void invented(void*, cles_job job, const cles_request*) {
    the_host->done(the_host, 0, text("1"));
    the_host->done(the_host, ~cles_job{0}, text("1"));
    the_host->fail(the_host, job + 1, text("failed"), text(""));
    the_host->progress(the_host, 12345, 0.5, text("{}"));
    the_host->job_log(the_host, 12345, 99, text("of no job"));
    const cles_callback callback{[](void*) {}, [](void* user) { ++*static_cast<int*>(user); }, new int{0}};
    the_host->on_stop(the_host, 12345, &callback);
    static std::atomic<int> answers{0};
    static std::thread::id here;
    here = std::this_thread::get_id();
    cles_ask ask{};
    ask.size = sizeof ask;
    ask.answered = [](void*, cles_text code, cles_text, cles_text) {
        answers += string(code) == "cancelled" && std::this_thread::get_id() != here ? 1 : 2;
    };
    the_host->delegate(the_host, 12345, text("PULL self:cles"), &ask);
    while (answers == 0) { // later, and on another thread, even if there is nothing to ask
        std::this_thread::yield();
    }
    const int drops = *static_cast<int*>(callback.user);
    delete static_cast<int*>(callback.user);
    const bool all = drops == 1 && answers == 1 && the_host->stopped(the_host, 12345) == 1;
    the_host->done(the_host, job, text(all ? "true" : "false"));
}

// A feed of no job, and of a job, and handles that are none.
void binds(void*, cles_job job, const cles_request*) {
    static std::atomic<int> ends{0};
    static std::thread::id here;
    here = std::this_thread::get_id();
    cles_next next{};
    next.size = sizeof next;
    next.event = [](void*, cles_text code, cles_text, const cles_event* event) {
        ends += string(code) == "cancelled" && event == nullptr && std::this_thread::get_id() != here ? 1 : 100;
    };
    cles_bind how{};
    how.size = sizeof how;
    const auto none = the_host->bind(the_host, 12345, text("self:fine"), &how);
    the_host->next(the_host, none, &next);
    the_host->next(the_host, 54321, &next);
    the_host->unbind(the_host, 54321);
    while (ends != 2) { // later, and on another thread
        std::this_thread::yield();
    }
    static cles_job current;
    static cles_feed feed;
    current = job;
    next.event = [](void*, cles_text code, cles_text, const cles_event* event) {
        const bool good = code.size == 0 && event->kind == CLES_FEED_CURRENT && string(event->json) == "{\"value\":7}";
        the_host->unbind(the_host, feed);
        the_host->unbind(the_host, feed);
        the_host->done(the_host, current, text(good ? "true" : "false"));
    };
    feed = the_host->bind(the_host, job, text("self:known"), &how);
    the_host->next(the_host, feed, &next);
}

// Asks for events of a feed that has ended, in its handler and in a callback, neither of which returns at once. The
// second callback tells whether two of them have run at the same time.
struct {
    cles_job job;
    cles_feed feed;
    std::atomic<int> calls, running;
    std::atomic<bool> overlap;
} in_turns;

void ask_in_turn();

void come_in_turn(void*, cles_text, cles_text, const cles_event*) {
    in_turns.overlap = in_turns.overlap || ++in_turns.running != 1;
    if (++in_turns.calls == 1) {
        ask_in_turn();
    } else {
        the_host->done(the_host, in_turns.job, text(in_turns.overlap ? "false" : "true"));
    }
    --in_turns.running;
}

void ask_in_turn() {
    cles_next next{};
    next.size = sizeof next;
    next.event = come_in_turn;
    const int before = in_turns.calls;
    the_host->next(the_host, in_turns.feed, &next);
    for (int i = 0; i < 20 && in_turns.calls == before; ++i) { // where it must not come
        std::this_thread::sleep_for(std::chrono::milliseconds{1});
    }
}

void takes_turns(void*, cles_job job, const cles_request*) {
    in_turns.running = 1;
    cles_bind how{};
    how.size = sizeof how;
    in_turns.job = job;
    in_turns.feed = the_host->bind(the_host, job, text("self:known"), &how);
    the_host->unbind(the_host, in_turns.feed);
    ask_in_turn();
    --in_turns.running;
}

// Which update the value of the feed is; or why there is none. Its body is the number of hops, of which 0 are written
// so.
void marks(void*, cles_job job, const cles_request* asked) {
    static cles_job current;
    current = job;
    cles_bind how{};
    how.size = sizeof how;
    how.mark = 1;
    how.hops = string(asked->body) == "[0]" ? CLES_NO_HOPS : string(asked->body) == "[17]" ? 17 : 0;
    const auto feed = the_host->bind(the_host, job, text("self:known"), &how);
    cles_next next{};
    next.size = sizeof next;
    next.event = [](void*, cles_text code, cles_text message, const cles_event* event) {
        if (code.size != 0) {
            the_host->fail(the_host, current, code, message);
            return;
        }
        const auto told = "[" + std::to_string(event->seq) + "," + (event->epoch != 0 ? "true" : "false") + "]";
        the_host->done(the_host, current, {told.data(), told.size()});
    };
    the_host->next(the_host, feed, &next);
}

void throws(void*, cles_job, const cles_request*) { throw std::runtime_error{"out of the plugin"}; }
void throws_anything(void*, cles_job, const cles_request*) { throw 7; }
void no_json(void*, cles_job job, const cles_request*) { the_host->done(the_host, job, text("{\"a\":")); }
void unknown_code(void*, cles_job job, const cles_request*) {
    the_host->fail(the_host, job, text("exploded"), text("as it does"));
}
void bad_progress(void*, cles_job job, const cles_request*) {
    the_host->progress(the_host, job, 0.5, text("nonsense"));
    the_host->progress(the_host, job, 7.5, text(""));
    the_host->publish(the_host, text("no such/\n"), text("1"));
    the_host->publish(the_host, text("fine"), text("{"));
    the_host->done(the_host, job, text(""));
}
void full(void*, cles_job job, const cles_request*) {
    std::thread{[job] { the_host->busy(the_host, job, text("the dock is full"), 250); }}.join();
    the_host->busy(the_host, job, text("once more"), 1);
}
void forgets(void*, cles_job, const cles_request*) {}
std::mutex mutex;
std::condition_variable changed;
int releases = 0;
bool over = false;

// Blocks its worker until the plugin is stopped or `release` is requested.
void hangs(void*, cles_job job, const cles_request*) {
    {
        std::unique_lock lock{mutex};
        changed.wait(lock, [before = releases] { return over || releases != before; });
    }
    the_host->done(the_host, job, text("\"released\""));
}
void set_over(bool value) {
    const std::scoped_lock lock{mutex};
    over = value;
    changed.notify_all();
}
// Its callback blocks its thread until the plugin is stopped.
void blocks_when_stopped(void*, cles_job job, const cles_request*) {
    const cles_callback callback{[](void*) {
                                     std::unique_lock lock{mutex};
                                     changed.wait(lock, [] { return over; });
                                 },
                                 [](void*) {}, nullptr};
    the_host->on_stop(the_host, job, &callback);
}
void release(void*, cles_job job, const cles_request*) {
    {
        const std::scoped_lock lock{mutex};
        ++releases;
    }
    changed.notify_all();
    the_host->done(the_host, job, text(""));
}
// Sends a request to a node that never replies, and records the result.
std::mutex told_mutex;
std::string told;
void asks(void*, cles_job job, const cles_request*) {
    cles_ask ask{};
    ask.size = sizeof ask;
    ask.answered = [](void*, cles_text code, cles_text, cles_text) {
        const std::scoped_lock lock{told_mutex};
        told += (told.empty() ? "" : " ") + string(code);
    };
    the_host->delegate(the_host, job, text("DELEGATE other:never"), &ask);
}
void what_it_was_told(void*, cles_job job, const cles_request*) {
    const std::scoped_lock lock{told_mutex};
    const auto json = '"' + told + '"';
    the_host->done(the_host, job, {json.data(), json.size()});
}
void undecided(void*, cles_job, const cles_request*) {}
void unwelcoming(void*, cles_job job, const cles_request*) {
    the_host->fail(the_host, job, text("denied"), text("not you"));
}
void too_late(void*, cles_job job, const cles_request*) {
    cles_task late{};
    late.size = sizeof late;
    late.verb = CLES_PULL;
    late.name = text("late");
    late.start = &forgets;
    the_host->done(the_host, job, text(the_host->add_task(the_host, &late) == CLES_TOO_LATE ? "true" : "false"));
}

// All requests that it received, unchanged.
void show(void*, cles_job job, const cles_request* asked) {
    std::string out =
        "{\"task\":\"" + string(asked->task) + "\",\"node\":\"" + string(asked->node) + "\",\"parameters\":[";
    for (size_t i = 0; i < asked->parameter_count; ++i) {
        out += (i == 0 ? "\"" : ",\"") + string(asked->parameters[i]) + "\"";
    }
    out += "],\"body\":" + string(asked->body) + ",\"verb\":" + std::to_string(asked->verb) +
           ",\"timely\":" + (asked->left_ns > 0 && asked->left_ns <= 30'000'000'000 ? "true" : "false") +
           ",\"transport\":\"" + string(asked->peer_transport) + "\",\"local\":" + std::to_string(asked->peer_local) +
           "}";
    the_host->done(the_host, job, {out.data(), out.size()});
}

void add(const cles_host* host, const char* name, void (*handler)(void*, cles_job, const cles_request*),
         uint32_t verb = CLES_DELEGATE, uint32_t flags = 0) {
    cles_task task{};
    task.size = sizeof task;
    task.verb = verb;
    task.name = text(name);
    task.start = handler;
    task.flags = flags;
    host->add_task(host, &task);
}

int32_t start(const cles_host* host, cles_text) {
    the_host = host;
    set_over(false);
    add(host, "twice", twice);
    add(host, "twice_elsewhere", twice_elsewhere);
    add(host, "invented", invented);
    add(host, "binds", binds);
    add(host, "takes_turns", takes_turns);
    add(host, "marks", marks);
    add(host, "throws", throws);
    add(host, "throws_anything", throws_anything);
    add(host, "no_json", no_json);
    add(host, "unknown_code", unknown_code);
    add(host, "bad_progress", bad_progress);
    add(host, "forgets", forgets);
    add(host, "full", full);
    add(host, "too_late", too_late);
    add(host, "show", show);
    add(host, "asks", asks);
    add(host, "told", what_it_was_told, CLES_PULL, CLES_TASK_INLINE_OK);
    add(host, "hangs", hangs, CLES_PULL);
    add(host, "blocks_when_stopped", blocks_when_stopped);
    add(host, "release", release, CLES_PUSH, CLES_TASK_INLINE_OK);
    add(host, "show", show, CLES_PULL);
    add(host, "undecided", undecided, CLES_BIND, CLES_TASK_INLINE_OK);
    add(host, "unwelcoming", unwelcoming, CLES_BIND, CLES_TASK_INLINE_OK);
    add(host, "patient", hangs, CLES_BIND);
    add(host, "idle", nullptr, CLES_PULL); // refused, and the plugin continues without it
    return 0;
}

void stop() {
    set_over(true);
    throw std::runtime_error{"out of stop"};
}

const cles_plugin description{.size = sizeof(cles_plugin),
                              .abi_major = CLES_PLUGIN_ABI_MAJOR,
                              .abi_minor = CLES_PLUGIN_ABI_MINOR,
                              .reserved = 0,
                              .name = {"rough", 5},
                              .version = {"0.1", 3},
                              .start = &start,
                              .stop = &stop};

} // namespace

extern "C" const cles_plugin* cles_plugin_v1() { return &description; }

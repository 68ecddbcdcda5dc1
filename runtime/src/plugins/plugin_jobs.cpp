// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_jobs.hpp"

#include <cles/plugin_text.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/post.hpp>

#include <memory>
#include <string>

namespace cles::runtime {
namespace {

using detail::abi_text;

// Posts the use of a responder, which is released there, too.
void post_to(responder to, std::function<void(const responder&)> use) {
    const auto executor = to.get_executor();
    boost::asio::post(executor, [to = std::move(to), use = std::move(use)] { use(to); });
}

// Errors of the plugin are ignored.
template <class... Parameters, class... Arguments>
void call_plugin(void (*function)(Parameters...), Arguments... arguments) noexcept {
    if (function != nullptr) {
        try {
            function(arguments...);
        } catch (...) { // ignored
        }
    }
}

thread_local plugin_turn* current_turn = nullptr;

constexpr std::string_view node_has_stopped = "the node has stopped";

// The error's name on the wire; empty on success.
std::string_view name_of(boost::system::error_code code) noexcept {
    const bool ours = code.category() == error_category() && code != errc::stopped;
    return !code ? std::string_view{} : wire_name(ours ? static_cast<errc>(code.value()) : errc::unavailable);
}

} // namespace

// -- callbacks -----------------------------------------------------------------------------------------------------

std::function<void()> plugin_callback(void (*call)(void*), void (*drop)(void*), void* user) {
    const std::shared_ptr<void> kept{user, [drop](void* dropped) { call_plugin(drop, dropped); }};
    return [kept, left = std::make_shared<std::atomic<decltype(call)>>(call)] {
        call_plugin(left->exchange(nullptr), kept.get());
    };
}

// -- handles -------------------------------------------------------------------------------------------------------

// A handle consists of a slot's number and generation, so that an old handle is invalid for the slot's next job.
plugin_jobs::slot* plugin_jobs::find(id job) noexcept {
    const auto index = static_cast<std::size_t>(job & 0xFFFFFFFFU);
    if (index >= slots_.size()) {
        return nullptr;
    }
    auto& s = slots_[index];
    return s.answer && s.generation == job >> 32U ? &s : nullptr;
}

plugin_jobs::id plugin_jobs::open(responder answer) {
    const std::scoped_lock lock{mutex_};
    if (closed_ || open_ >= max_open) {
        return 0;
    }
    if (free_.empty()) {
        free_.push_back(static_cast<std::uint32_t>(slots_.size()));
        slots_.emplace_back();
    }
    const auto index = free_.back();
    free_.pop_back();
    auto& s = slots_[index];
    if (++s.generation == 0) {
        s.generation = 1; // avoids the handle 0
    }
    s.stopped = false;
    s.thread_safe = answer.is_thread_safe();
    s.starting_thread = std::this_thread::get_id();
    s.answer.emplace(std::move(answer));
    ++open_;
    return (static_cast<id>(s.generation) << 32U) | index;
}

void plugin_jobs::started(id job) {
    const std::scoped_lock lock{mutex_};
    if (auto* s = find(job)) {
        s->starting_thread = {};
    }
}

plugin_jobs::slot plugin_jobs::release(id job) {
    auto* s = find(job);
    slot out{.answer = std::exchange(s->answer, std::nullopt), .on_stop = std::exchange(s->on_stop, nullptr)};
    free_.push_back(static_cast<std::uint32_t>(job & 0xFFFFFFFFU));
    --open_;
    return out;
}

// -- use of the responders -----------------------------------------------------------------------------------------

std::optional<responder> plugin_jobs::take_if_direct(id job) {
    slot gone;
    const std::scoped_lock lock{mutex_};
    if (const auto* s = find(job); s != nullptr && is_direct(*s)) {
        gone = release(job);
    }
    return std::exchange(gone.answer, std::nullopt);
}

bool plugin_jobs::finish(id job, std::function<void(const responder&)> answer) {
    slot gone;
    {
        const std::scoped_lock lock{mutex_};
        const auto* s = find(job);
        if (s == nullptr) {
            ++unknown_answers_;
            return false;
        }
        const bool direct = is_direct(*s);
        gone = release(job);
        if (!direct) {
            // With the lock, so that nothing is posted after `close` to an executor that may be gone.
            post_to(*std::exchange(gone.answer, std::nullopt), std::move(answer));
            return true;
        }
    }
    answer(*gone.answer);
    return true;
}

bool plugin_jobs::use(id job, std::function<void(const responder&)> use) {
    std::optional<responder> here;
    {
        const std::scoped_lock lock{mutex_};
        const auto* s = find(job);
        if (s == nullptr) {
            return false;
        }
        if (!is_direct(*s)) {
            post_to(*s->answer, std::move(use));
            return true;
        }
        here = s->answer;
    }
    use(*here);
    return true;
}

std::optional<responder> plugin_jobs::find_shared(id job) {
    const std::scoped_lock lock{mutex_};
    const auto* s = find(job);
    return s != nullptr && s->thread_safe ? s->answer : std::nullopt;
}

bool plugin_jobs::stopped(id job) {
    const std::scoped_lock lock{mutex_};
    const auto* s = find(job);
    return s == nullptr || s->stopped || (s->thread_safe && s->answer->stopped());
}

void plugin_jobs::on_stop(id job, std::function<void()> callback) {
    std::function<void()> replaced; // destroyed without the lock
    std::optional<responder> by;
    {
        const std::scoped_lock lock{mutex_};
        auto* s = find(job);
        if (s == nullptr) {
            return;
        }
        if (!s->stopped) {
            if (s->thread_safe) {
                by = s->answer;
            }
            replaced = std::exchange(s->on_stop, callback);
            if (!by) {
                callback = {}; // `stop` returns it
            }
        }
    }
    if (by) {
        by->on_stop(callback);
    } else if (callback) {
        callback();
    }
}

std::function<void()> plugin_jobs::stop(id job) {
    const std::scoped_lock lock{mutex_};
    auto* s = find(job);
    if (s == nullptr) {
        return {};
    }
    s->stopped = true;
    return std::exchange(s->on_stop, {});
}

// -- close ---------------------------------------------------------------------------------------------------------

std::vector<std::function<void()>> plugin_jobs::close(const std::function<void(const responder&)>& answer) {
    std::vector<slot> gone;
    {
        const std::scoped_lock lock{mutex_};
        closed_ = true;
        for (std::size_t i = 0; i < slots_.size(); ++i) {
            if (slots_[i].answer) {
                gone.push_back(release((static_cast<id>(slots_[i].generation) << 32U) | i));
            }
        }
    }
    std::vector<std::function<void()>> callbacks;
    for (auto& s : gone) {
        answer(*s.answer);
        if (s.on_stop) {
            callbacks.push_back(std::move(s.on_stop));
        }
    }
    return callbacks;
}

std::size_t plugin_jobs::size() const {
    const std::scoped_lock lock{mutex_};
    return open_;
}

std::uint64_t plugin_jobs::unknown_answers() const {
    const std::scoped_lock lock{mutex_};
    return unknown_answers_;
}

// -- turns ---------------------------------------------------------------------------------------------------------

plugin_turn::plugin_turn(plugin_jobs::id job) noexcept : job_(job), outer_(std::exchange(current_turn, this)) {}

plugin_turn::~plugin_turn() {
    int round = 0;
    while (!waiting_.empty() && (++round <= most_rounds || !pass_on())) {
        for (const auto& each : std::exchange(waiting_, {})) {
            each();
        }
    }
    current_turn = outer_;
}

// Returns false if that is not possible.
bool plugin_turn::pass_on() noexcept {
    try {
        elsewhere_([job = job_, waiting = waiting_, elsewhere = elsewhere_] {
            plugin_turn next{job};
            next.waiting_ = waiting;
            next.elsewhere_ = elsewhere;
        });
        return true;
    } catch (...) { // no memory
        return false;
    }
}

plugin_jobs::id plugin_turn::current_job() noexcept { return current_turn == nullptr ? 0 : current_turn->job_; }

void plugin_turn::call_at_end(std::function<void()> what, other_thread elsewhere) {
    current_turn->elsewhere_ = std::move(elsewhere);
    current_turn->waiting_.push_back(std::move(what));
}

// -- what jobs wait for --------------------------------------------------------------------------------------------

plugin_request::~plugin_request() { complete(errc::unavailable, "{}", node_has_stopped); }

void plugin_request::complete(boost::system::error_code code, std::string_view json,
                              std::string_view message) noexcept {
    if (!claim() || answered_ == nullptr) {
        return;
    }
    const auto name = name_of(code);
    const auto result = code ? std::string_view{"{}"} : json;
    try {
        if (is_sending()) {
            defer([call = answered_, user = user_, name, result = std::string{result}, text = std::string{message}] {
                call_plugin(call, user, abi_text(name), abi_text(result), abi_text(text));
            });
            return;
        }
    } catch (...) { // no memory or no thread: better now than never
    }
    plugin_turn turn{job()};
    call_plugin(answered_, user_, abi_text(name), abi_text(result), abi_text(message));
}

void plugin_request::report_progress(double fraction, std::string_view json) noexcept {
    if (!is_claimed()) {
        plugin_turn turn{job()};
        call_plugin(progress_, user_, fraction, abi_text(json));
    }
}

plugin_next::~plugin_next() { complete(errc::unavailable, {.text = node_has_stopped}); }

void plugin_next::complete(boost::system::error_code code, const job_event& what) noexcept {
    if (!claim() || event_ == nullptr) {
        return;
    }
    if (!code) { // it comes on a worker
        const cles_event event{.size = sizeof(cles_event),
                               .kind = static_cast<std::uint32_t>(what.kind),
                               .json = abi_text(what.json),
                               .publisher = abi_text(what.publisher),
                               .seq = what.seq,
                               .missed = what.missed,
                               .text = abi_text(what.text),
                               .waited_ns = what.waited.count(),
                               .epoch = what.epoch,
                               .reserved = 0};
        plugin_turn turn{job()};
        call_plugin(event_, user_, cles_text{}, cles_text{}, &event);
        return;
    }
    const auto name = name_of(code);
    try {
        if (is_sending()) {
            defer([call = event_, user = user_, name, text = std::string{what.text}] {
                call_plugin(call, user, abi_text(name), abi_text(text), nullptr);
            });
            return;
        }
    } catch (...) { // as above
    }
    plugin_turn turn{job()};
    call_plugin(event_, user_, abi_text(name), abi_text(what.text), nullptr);
}

} // namespace cles::runtime

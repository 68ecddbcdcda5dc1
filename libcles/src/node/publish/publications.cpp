// SPDX-License-Identifier: BSL-1.0
#include "node/publish/publications.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "node/base/scoped_flag.hpp"
#include "node/publish/group_bindings.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/task_execution.hpp"
#include "port/node_security.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

namespace cles::core {
namespace {

std::string_view task_of(std::string_view path) { return path.substr(0, path.find('/')); }

} // namespace

publications::publications(topic_context shared, const cles::limits& bounds, completion_queue& completions,
                           std::string publisher, std::string epoch, unsent_topics& unsent,
                           const task_registry* registered, const node_security* security)
    : shared_(std::move(shared)), bounds_(bounds), completions_(completions), publisher_(std::move(publisher)),
      epoch_(std::move(epoch)), unsent_(unsent), registered_(registered), security_(security) {}

topic* publications::find(std::string_view path) noexcept {
    if (recent_ != nullptr && recent_->path() == path) {
        return recent_;
    }
    const auto found = topics_.find(path);
    return found == topics_.end() ? nullptr : found->second.get();
}

bool publications::knows(std::string_view task) const noexcept { return nouns_.contains(task); }

bool publications::can_open(std::string_view path) noexcept {
    const auto nouns = nouns_.find(task_of(path));
    return nouns == nouns_.end() || nouns->second->count < bounds_.nouns || find(path) != nullptr;
}

bool publications::can_publish(std::string_view path) noexcept {
    return can_open(path) || oldest_idle(*nouns_.find(task_of(path))->second) != nullptr;
}

topic& publications::open(std::string_view path) { return open(path, false); }

topic& publications::open(std::string_view path, bool to_publish) {
    if (auto* existing = find(path)) {
        return *existing;
    }
    const auto task = task_of(path);
    auto& nouns = nouns_[std::string{task}];
    if (!nouns) {
        nouns = std::make_unique<task_nouns>();
    }
    if (nouns->count >= bounds_.nouns) {
        auto* oldest = to_publish ? oldest_idle(*nouns) : nullptr;
        if (oldest == nullptr) {
            throw error(errc::busy, "'" + std::string{task} + "' has " + std::to_string(nouns->count) +
                                        (to_publish ? " nouns that are bound" : " nouns already"));
        }
        retire(*oldest);
    }
    ++nouns->count;
    // Numbered above all nouns that were removed, so that a noun that returns never reuses a number.
    auto made = std::make_unique<topic>(shared_, std::string{path}, highest_retired_, nouns.get());
    auto& result = *made;
    topics_.emplace(std::string{path}, std::move(made));
    for (auto* const each : watching_) { // none changes the list
        each->on_opened(result);
    }
    return result;
}

// Nouns that were bound meanwhile leave the list; they return when their last subscriber has gone.
topic* publications::oldest_idle(task_nouns& of) noexcept {
    while (!of.idle.empty()) {
        auto& oldest = of.idle.front();
        if (!oldest.is_bound() && oldest.waiters().empty()) {
            return &oldest;
        }
        of.idle.pop_front();
    }
    return nullptr;
}

void publications::mark_used(topic& t) noexcept {
    if (t.is_bound()) {
        return; // if it is still in the list, `oldest_idle` removes it
    }
    auto& idle = t.task->idle;
    if (t.is_linked()) {
        if (&idle.back() == &t) {
            return;
        }
        t.unlink();
    }
    idle.push_back(t);
}

void publications::remove_if_unused(topic& t) {
    if (t.is_bound() || t.is_begun() || !t.waiters().empty()) {
        return;
    }
    if (t.has_value()) {
        mark_used(t);
    } else {
        remove(t);
    }
}

bool publications::retire(std::string_view path) {
    auto* t = find(path);
    if (t == nullptr || !t->has_value() || t->is_begun()) {
        return false;
    }
    retire(*t);
    return true;
}

std::size_t publications::retire_all(std::string_view task) {
    std::vector<std::string> paths;
    for (const auto& [path, each] : topics_) {
        if (task_of(path) == task) {
            paths.push_back(path);
        }
    }
    return static_cast<std::size_t>(std::ranges::count_if(paths, [this](const auto& path) { return retire(path); }));
}

void publications::retire(topic& t) {
    ++shared_.counts.nouns_retired;
    t.retire();
    remove_if_unused(t);
}

void publications::remove(topic& t) {
    highest_retired_ = std::max(highest_retired_, t.seq());
    const std::string path = t.path();
    // A task that has been published stays open for BIND, even without nouns.
    if (--t.task->count == 0 && !t.task->published) {
        t.unlink();
        nouns_.erase(std::string{task_of(path)});
    }
    unsent_.forget(t);
    if (recent_ == &t) {
        recent_ = nullptr;
    }
    topics_.erase(path);
}

void publications::publish(std::string_view path, const std::function<void(json_writer&)>& write) {
    const bool is_signed = must_sign(path);
    auto& t = open(path, true);
    if (t.is_begun()) {
        throw error(errc::failed, "'" + t.path() + "' cannot be published while a value of it is being written");
    }
    if (t.is_linked()) {
        t.unlink(); // it must not retire while it is written, whatever else is published meanwhile
    }
    auto& line = t.begin();
    const auto start = line.size();
    protocol::append_update_head(line, publisher_, t.path(), t.seq() + 1, epoch_);
    auto body = line.size();
    try {
        json_writer writer{line};
        write(writer);
        cles::detail::require_readable(writer);
        close_body(line, body);
        body = is_signed ? sign(t, line, body) : body;
        end(t, body - start);
    } catch (...) {
        t.roll_back();
        remove_if_unused(t);
        throw;
    }
}

bool publications::must_sign(std::string_view path) const {
    if (registered_ == nullptr || !registered_->is_signed(task_of(path))) {
        return false;
    }
    if (security_ == nullptr) {
        throw error(errc::denied,
                    "updates of '" + std::string{path} + "' must be signed, and " + publisher_ + " has no security");
    }
    return true;
}

std::size_t publications::sign(const topic& t, std::string& line, std::size_t body) const {
    const auto made = security_->sign_update(t.path(), t.seq() + 1, epoch_, std::string_view{line}.substr(body));
    const auto adverb = "sig=" + made + " ";
    line.insert(body, adverb);
    return body + adverb.size();
}

// When memory runs out, updates that slow subscribers have not taken are dropped first; then idle nouns retire.
void publications::take_memory(topic& t) {
    if (t.account_memory()) {
        return;
    }
    if (!lossless_) {
        t.shed();
    }
    while (!t.account_memory()) {
        auto* oldest = oldest_idle(*t.task);
        if (oldest == nullptr) {
            throw error(errc::busy, "an update of '" + t.path() + "' needs more memory than is left (limits.memory)");
        }
        retire(*oldest);
    }
}

void publications::publish_body(std::string_view path, std::string_view body) {
    publish(path, [body](json_writer& w) { w.checked(body); });
}

void publications::end(topic& t, std::size_t body_at) {
    const auto line = t.pending();
    if (line.size() > bounds_.line) {
        throw error(errc::too_large, "an update of '" + t.path() + "' has " + std::to_string(line.size()) +
                                         " bytes, the limit is " + std::to_string(bounds_.line) + " (limits.line)");
    }
    if (protocol::begins_with_error(line.substr(body_at))) {
        throw error(errc::failed, "an update whose first key is 'error' would be read as a failure");
    }
    take_memory(t);
    t.commit(body_at);
    t.task->published = true;
    mark_used(t);
    recent_ = &t;
    unsent_.mark(t);
}

void publications::publish_lossless(std::string_view path, std::string_view body) {
    const scoped_flag all_of_it{lossless_};
    publish_body(path, body);
}

bool publications::publish_or_wait(std::string_view path, std::string_view body, detail::pending_ptr& operation,
                                   std::uint64_t ticket) {
    auto& t = open(path, true);
    if (!t.waiters().empty() || !t.has_capacity()) {
        t.waiters().push_back({std::string{body}, std::move(operation), ticket});
        return false;
    }
    publish_lossless(path, body);
    completions_.succeed(std::move(operation), "{}");
    return true;
}

bool publications::cancel(std::uint64_t ticket) {
    for (auto& [path, t] : topics_) {
        auto& waiting = t->waiters();
        const auto found =
            std::find_if(waiting.begin(), waiting.end(), [ticket](const auto& w) { return w.ticket == ticket; });
        if (found != waiting.end()) {
            auto operation = std::move(found->operation);
            waiting.erase(found);
            completions_.fail(std::move(operation), errc::cancelled, "the update was cancelled");
            return true;
        }
    }
    return false;
}

void publications::admit(topic& t) {
    auto& waiting = t.waiters();
    while (!waiting.empty() && t.has_capacity()) {
        boost::system::error_code code;
        std::string why;
        try {
            publish_lossless(t.path(), waiting.front().body);
        } catch (const error& e) {
            code = e.code();
            why = e.message();
        }
        auto operation = std::move(waiting.front().operation);
        waiting.pop_front(); // only now: a topic without waiters may be removed when publishing fails
        if (code) {
            completions_.fail(std::move(operation), code, why);
        } else {
            completions_.succeed(std::move(operation), "{}");
        }
    }
}

std::vector<detail::pending_ptr> publications::take_waiters() {
    std::vector<detail::pending_ptr> taken;
    for (auto& [path, t] : topics_) {
        for (auto& w : std::exchange(t->waiters(), {})) {
            taken.push_back(std::move(w.operation));
        }
    }
    return taken;
}

std::set<std::string> publications::tasks() const {
    std::set<std::string> names;
    for (const auto& [task, nouns] : nouns_) {
        if (nouns->published) {
            names.insert(task);
        }
    }
    return names;
}

std::set<std::string> publications::paths() const {
    std::set<std::string> found;
    for (const auto& [path, each] : topics_) {
        if (each->has_value()) {
            found.insert(path);
        }
    }
    return found;
}

} // namespace cles::core

// SPDX-License-Identifier: BSL-1.0
#include "core/publications.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "core/result_text.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

std::string_view task_of(std::string_view path) { return path.substr(0, path.find('/')); }

} // namespace

publications::publications(topic_context shared, const cles::limits& bounds, std::string publisher, std::string epoch,
                           std::function<void()> wake)
    : shared_(shared), bounds_(bounds), publisher_(std::move(publisher)), epoch_(std::move(epoch)),
      wake_(std::move(wake)) {}

topic* publications::find(std::string_view path) noexcept {
    if (recent_ != nullptr && recent_->path() == path) {
        return recent_;
    }
    const auto found = topics_.find(path);
    return found == topics_.end() ? nullptr : found->second.get();
}

bool publications::knows(std::string_view task) const noexcept { return nouns_.contains(task); }

bool publications::can_open(std::string_view path) noexcept {
    const auto count = nouns_.find(task_of(path));
    return count == nouns_.end() || count->second.count < bounds_.nouns || find(path) != nullptr;
}

topic& publications::open(std::string_view path) {
    if (auto* existing = find(path)) {
        return *existing;
    }
    const auto task = task_of(path);
    auto& count = nouns_[std::string{task}].count;
    if (count >= bounds_.nouns) {
        throw error(errc::busy, "'" + std::string{task} + "' has " + std::to_string(count) + " nouns already");
    }
    ++count;
    auto made = std::make_unique<topic>(shared_, std::string{path});
    auto& result = *made;
    topics_.emplace(std::string{path}, std::move(made));
    if (opened_) {
        opened_(result);
    }
    return result;
}

void publications::tidy(topic& t) {
    if (t.is_bound() || t.seq() != 0 || !t.waiters().empty()) {
        return;
    }
    const std::string path = t.path();
    const auto count = nouns_.find(task_of(path));
    if (count != nouns_.end() && --count->second.count == 0) {
        nouns_.erase(count);
    }
    std::erase(dirty_, &t);
    if (recent_ == &t) {
        recent_ = nullptr;
    }
    topics_.erase(path);
}

void publications::publish(std::string_view path, const std::function<void(json_writer&)>& write) {
    auto& t = open(path);
    auto& line = t.begin();
    const auto start = line.size();
    protocol::append_update_head(line, publisher_, t.path(), t.seq() + 1, epoch_);
    const auto body = line.size();
    try {
        json_writer writer{line};
        write(writer);
        cles::detail::require_utf8(writer);
        close_result(line, body);
        end(t, body - start);
    } catch (...) {
        t.roll_back();
        tidy(t);
        throw;
    }
}

void publications::publish_body(std::string_view path, std::string_view body) {
    publish(path, [body](json_writer& w) { w.raw(body); });
}

void publications::end(topic& t, std::size_t body_at) {
    const auto line = t.pending();
    if (line.size() > bounds_.line) {
        throw error(errc::too_large, "an update of '" + t.path() + "' has " + std::to_string(line.size()) +
                                         " bytes, the limit is " + std::to_string(bounds_.line));
    }
    if (protocol::begins_with_error(line.substr(body_at))) {
        throw error(errc::failed, "an update whose first key is 'error' would be taken for a failure");
    }
    t.commit(body_at);
    if (t.seq() == 1) {
        ++nouns_.find(task_of(t.path()))->second.published;
    }
    recent_ = &t;
    to_binders_ += t.is_bound() ? 1U : 0U;
    mark(t);
}

void publications::mark(topic& t) {
    if (t.is_bound() && std::find(dirty_.begin(), dirty_.end(), &t) == dirty_.end()) {
        dirty_.push_back(&t);
        if (dirty_.size() == 1) {
            wake_();
        }
    }
}

bool publications::publish_when_room(std::string_view path, std::string_view body, detail::pending_ptr& operation,
                                     std::uint64_t ticket) {
    auto& t = open(path);
    if (!t.waiters().empty() || !t.has_room()) {
        t.waiters().push_back({std::string{body}, std::move(operation), ticket});
        return false;
    }
    publish_body(path, body);
    keep({.operation = std::move(operation)});
    return true;
}

bool publications::cancel(std::uint64_t ticket) {
    for (auto& [path, t] : topics_) {
        auto& waiting = t->waiters();
        const auto found =
            std::find_if(waiting.begin(), waiting.end(), [ticket](const auto& w) { return w.ticket == ticket; });
        if (found != waiting.end()) {
            publication_result result{
                .operation = std::move(found->operation), .code = errc::cancelled, .why = "the update was withdrawn"};
            waiting.erase(found);
            keep(std::move(result));
            return true;
        }
    }
    return false;
}

// Told later, one by one: a publisher that goes on at once may publish again, or throw, or end it all.
void publications::keep(publication_result result) {
    results_.push_back(std::move(result));
    if (results_.size() == 1) {
        wake_();
    }
}

std::optional<publication_result> publications::next_result() {
    if (results_.empty()) {
        return std::nullopt;
    }
    auto next = std::move(results_.front());
    results_.pop_front();
    return next;
}

void publications::admit(topic& t) {
    auto& waiting = t.waiters();
    while (!waiting.empty() && t.has_room()) {
        publication_result result;
        try {
            publish_body(t.path(), waiting.front().body);
        } catch (const error& e) {
            result.code = e.code();
            result.why = e.message();
        }
        result.operation = std::move(waiting.front().operation);
        waiting.pop_front(); // only now: a topic for which nobody waits may go where publishing fails
        keep(std::move(result));
    }
}

void publications::drain(time_point now) {
    auto batch = std::exchange(dirty_, {});
    for (auto* t : batch) {
        t->drain(now);
    }
    for (auto* t : batch) {
        admit(*t);
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

std::vector<std::string> publications::tasks() const {
    std::vector<std::string> names;
    for (const auto& [task, nouns] : nouns_) {
        if (nouns.published != 0) {
            names.push_back(task);
        }
    }
    std::sort(names.begin(), names.end());
    return names;
}

} // namespace cles::core

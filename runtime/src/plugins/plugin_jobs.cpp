// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_jobs.hpp"

#include <boost/asio/post.hpp>

namespace cles::runtime {
namespace {

// Posts the use of a responder, which is let go of there too.
void post_to(responder to, std::function<void(const responder&)> use) {
    const auto executor = to.get_executor();
    boost::asio::post(executor, [to = std::move(to), use = std::move(use)] { use(to); });
}

} // namespace

// -- callbacks -----------------------------------------------------------------------------------------------------

plugin_callback::~plugin_callback() {
    if (drop_ != nullptr) {
        try {
            drop_(user_);
        } catch (...) { // a plugin's mistake is not ours
        }
    }
}

void plugin_callback::operator()() {
    if (const auto call = std::exchange(call_, nullptr); call != nullptr) {
        try {
            call(user_);
        } catch (...) { // as above
        }
    }
}

// -- handles -------------------------------------------------------------------------------------------------------

// A handle is a slot's number and generation, so that an old one does not fit the slot's next job.
plugin_jobs::slot* plugin_jobs::find(id job) noexcept {
    return const_cast<slot*>(std::as_const(*this).find(job)); // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

const plugin_jobs::slot* plugin_jobs::find(id job) const noexcept {
    const auto index = static_cast<std::size_t>(job & 0xFFFFFFFFU);
    if (index >= slots_.size()) {
        return nullptr;
    }
    const auto& s = slots_[index];
    return s.answer && s.generation == job >> 32U ? &s : nullptr;
}

plugin_jobs::id plugin_jobs::open(responder answer) {
    const std::scoped_lock lock{mutex_};
    if (closed_ || open_ >= most) {
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
        s.generation = 1; // 0 would make the handle 0 in the first slot
    }
    s.stopped = false;
    s.anywhere = answer.is_thread_safe();
    s.starter = std::this_thread::get_id();
    s.answer.emplace(std::move(answer));
    ++open_;
    return (static_cast<id>(s.generation) << 32U) | index;
}

void plugin_jobs::started(id job) {
    const std::scoped_lock lock{mutex_};
    if (auto* s = find(job)) {
        s->starter = {};
    }
}

plugin_jobs::slot plugin_jobs::release(id job) {
    auto* s = find(job);
    slot out{.answer = std::exchange(s->answer, std::nullopt), .on_stop = std::move(s->on_stop)};
    free_.push_back(static_cast<std::uint32_t>(job & 0xFFFFFFFFU));
    --open_;
    return out;
}

// -- what a plugin says --------------------------------------------------------------------------------------------

std::optional<responder> plugin_jobs::take_here(id job) {
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
            ++unknown_;
            return false;
        }
        const bool direct = is_direct(*s);
        gone = release(job);
        if (!direct) {
            // With the lock: once `close` returns, nobody posts to an executor that may be gone.
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

bool plugin_jobs::stopped(id job) const {
    const std::scoped_lock lock{mutex_};
    const auto* s = find(job);
    return s == nullptr || s->stopped || (s->anywhere && s->answer->stopped());
}

void plugin_jobs::on_stop(id job, plugin_callback callback) {
    shared_callback wanted{std::move(callback)};
    shared_callback replaced; // goes without the lock
    std::optional<responder> by;
    {
        const std::scoped_lock lock{mutex_};
        auto* s = find(job);
        if (s == nullptr) {
            return;
        }
        if (!s->stopped) {
            if (s->anywhere) {
                by = s->answer;
            }
            replaced = std::exchange(s->on_stop, wanted);
            if (!by) {
                wanted = {}; // `stop` hands it out
            }
        }
    }
    if (by) {
        by->on_stop([wanted] { wanted(); });
    } else {
        wanted();
    }
}

shared_callback plugin_jobs::stop(id job) {
    const std::scoped_lock lock{mutex_};
    auto* s = find(job);
    if (s == nullptr) {
        return {};
    }
    s->stopped = true;
    return std::exchange(s->on_stop, {});
}

// -- the end -------------------------------------------------------------------------------------------------------

std::vector<shared_callback> plugin_jobs::close(const std::function<void(const responder&)>& answer) {
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
    std::vector<shared_callback> told;
    for (auto& s : gone) {
        answer(*s.answer);
        told.push_back(std::move(s.on_stop));
    }
    return told;
}

std::size_t plugin_jobs::size() const {
    const std::scoped_lock lock{mutex_};
    return open_;
}

std::uint64_t plugin_jobs::unknown() const {
    const std::scoped_lock lock{mutex_};
    return unknown_;
}

} // namespace cles::runtime

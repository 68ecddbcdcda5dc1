// SPDX-License-Identifier: BSL-1.0
#include "core/relayed_bindings.hpp"

#include "core/all_binding.hpp"

#include <algorithm>

namespace cles::core {
namespace {

std::string noun_of(std::string_view node, std::string_view path) { return std::string{node}.append(":").append(path); }

bool has(const std::vector<std::string>& all, std::string_view one) {
    return std::find(all.begin(), all.end(), one) != all.end();
}

} // namespace

relayed_bindings::~relayed_bindings() { clear(); }

void relayed_bindings::bind(std::string_view node, std::string_view path, std::string_view adverbs,
                            binding::terms wanted, bool wants_mark, const std::shared_ptr<call>& c) {
    std::erase_if(asking_, [](const asking& a) {
        const auto waits = a.answers.lock();
        return !waits || waits->ended();
    });
    auto noun = noun_of(node, path);
    asking_.push_back({noun, c});
    from_->join(node, path, adverbs, c,
                [this, weak = std::weak_ptr{c}, wanted, wants_mark, noun](topic* t, std::string_view last,
                                                                          const protocol::failure& why) {
                    const auto waits = weak.lock();
                    if (!waits || waits->ended()) { // and this may be gone with its link
                        return;
                    }
                    if (t == nullptr) {
                        waits->fail(why);
                        return;
                    }
                    if (!waits->can_answer(last.size())) {
                        waits->fail(
                            {.code = errc::busy, .message = "no memory is left for the answer (limits.memory)"});
                        return;
                    }
                    // Bound before the answer, which may set off what else the peer asked for; updates follow it later.
                    bound_.bind(*t, wanted);
                    if (!has(by_name_, noun)) {
                        by_name_.push_back(noun);
                    }
                    if (wants_mark) {
                        waits->set_head(protocol::mark_text(from_->mark_of(*t)));
                    }
                    waits->done(last);
                });
}

bool relayed_bindings::binds(std::string_view target, std::string_view path) {
    return target == "all" ? all_.find(path) != all_.end() : bound_.has(noun_of(target, path));
}

void relayed_bindings::withdraw(std::string_view noun) {
    for (const auto& a : std::vector<asking>{asking_}) {
        if (a.noun != noun) {
            continue;
        }
        if (const auto c = a.answers.lock(); c && !c->ended()) {
            c->fail({.code = errc::cancelled, .message = "it was unbound"});
        }
    }
}

void relayed_bindings::unbind(std::string_view target, std::string_view path) {
    if (target == "all") {
        if (const auto held = all_.extract(std::string{path}); !held.empty()) {
            held.mapped()->close();
        }
        return;
    }
    const auto noun = noun_of(target, path);
    withdraw(noun);
    std::erase(by_name_, noun);
    bound_.unbind(noun);
}

void relayed_bindings::clear() {
    for (const auto& [path, all] : std::exchange(all_, {})) {
        all->close();
    }
    by_name_.clear();
    asking_.clear();
    bound_.clear();
}

// -- parts of all --------------------------------------------------------------------------------------------------

void relayed_bindings::take_part(topic& t, binding::terms wanted) {
    if (!has(by_name_, t.path())) {
        bound_.bind(t, wanted);
    }
}

void relayed_bindings::leave_part(std::string_view noun) {
    if (!has(by_name_, noun)) {
        bound_.unbind(noun);
    }
}

topic* relayed_bindings::take_own_part(std::string_view path, binding::terms wanted) {
    if (!published_.can_open(path)) {
        return nullptr;
    }
    auto& t = published_.open(path);
    if (!own_.has(path)) {
        own_by_all_.emplace_back(path);
    }
    if (has(own_by_all_, path)) {
        own_.bind(t, wanted);
    }
    return &t;
}

void relayed_bindings::leave_own_part(std::string_view path) {
    if (std::erase(own_by_all_, path) != 0) {
        own_.unbind(path);
    }
}

} // namespace cles::core

// SPDX-License-Identifier: BSL-1.0
#include "support/conversation.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/tracing.hpp>

#include "protocol/grammar.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <utility>

namespace cles::test {
namespace {

constexpr std::size_t longest_text = 1'000'000;
constexpr std::uint64_t longest_pass = 100'000'000; // milliseconds

/// Removes and returns the first word.
std::string_view word(std::string_view& rest) {
    const auto end = std::min(rest.find(' '), rest.size());
    const auto first = rest.substr(0, end);
    rest.remove_prefix(end == rest.size() ? end : end + 1);
    return first;
}

std::uint64_t number(std::string_view text, std::uint64_t most) {
    const auto n = protocol::number_between(text, 0, most);
    if (!n) {
        throw script_error{"'" + std::string{text} + "' is no number from 0 to " + std::to_string(most)};
    }
    return *n;
}

/// JSON as handlers and programs pass it: valid, without white space. Empty text stays empty.
std::string json(std::string_view text) {
    std::string compact;
    if (!text.empty() && !is_valid_json(text)) {
        throw script_error{"'" + std::string{text} + "' is not JSON"};
    }
    append_compact_json(text, compact);
    return compact;
}

cles::verb verb_named(std::string_view name) {
    const auto v = verb_from(name);
    if (!v) {
        throw script_error{"'" + std::string{name} + "' is no verb"};
    }
    return *v;
}

protocol::noun_view noun(std::string_view text) {
    protocol::noun_view parts;
    std::string why;
    if (!protocol::parse_noun(text, parts, why)) {
        throw script_error{why};
    }
    return parts;
}

/// The text after `>>`, with \t, \r, \\ and \xHH decoded.
std::string unescaped(std::string_view text) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '\\' || i + 1 == text.size()) {
            out.push_back(text[i]);
            continue;
        }
        switch (text[++i]) {
        case 't': out.push_back('\t'); break;
        case 'r': out.push_back('\r'); break;
        case 'x':
            out.push_back(static_cast<char>(std::strtoul(std::string{text.substr(i + 1, 2)}.c_str(), nullptr, 16)));
            i += std::min<std::size_t>(2, text.size() - i - 1);
            break;
        default: out.push_back(text[i]);
        }
    }
    return out;
}

std::string name_on(char link) { return link == 'a' ? std::string{} : std::string{link}; }

} // namespace

conversation::conversation() = default;

conversation::~conversation() {
    links_.clear(); // they refer to the node and the feeds
    if (node_) {
        node_->started.clear();
    }
}

bool conversation::is_step(std::string_view line) {
    if (!line.empty() && line.front() >= 'a' && line.front() <= 'z') {
        line.remove_prefix(1);
    }
    return line.starts_with('>') || line.starts_with('@');
}

std::vector<std::string> conversation::take() { return std::exchange(told_, {}); }

// -- the node and its tasks ----------------------------------------------------------------------------------------

void conversation::make_node() {
    if (node_) {
        return;
    }
    node_ = std::make_unique<test_node>(
        bounds, [](const access& wanted) { return wanted.task != "secret"; }, log_sink{},
        core::completion_queue::runner{}, std::shared_ptr<core::node_security>{}, tracing());
    add_quick_tasks();
    add_later_tasks();
}

void conversation::add_quick_tasks() {
    auto& node = *node_;
    node.on(verb::pull, "speed", R"({"v":27.5})");
    node.on(verb::pull, "secret", "{}");
    node.on(verb::pull, "number", "42");
    node.on(verb::pull, "list", "[1,2]");
    node.on(verb::pull, "nothing", "");
    node.on(verb::pull, "misleading", R"({"error":"it only looks like one"})");
    node.on(verb::pull, "echo", [](const request& r, json_writer& w) {
        w.begin_object();
        w.key("parameters");
        w.begin_array();
        for (const auto p : r.parameters()) {
            w.value(p);
        }
        w.end_array();
        w.end_object();
    });
    // Long enough to exceed the limit.
    node.on(verb::pull, "text", [longest = std::min(bounds.line * 2, longest_text)](const request& r, json_writer& w) {
        w.value(std::string(std::min(r.parameter<std::size_t>(0), longest), 'x'));
    });
    const auto give_back = [](const request& r, json_writer& w) {
        std::string body;
        append_compact_json(r.body(), body);
        w.raw(body);
    };
    node.on(verb::push, "echo", give_back);
    node.on(verb::delegate, "echo", give_back);
    node.on(verb::push, "fail",
            [](const request& r, json_writer&) { throw error(errc_from_wire(r.parameter(0)), "as it was asked to"); });
    node.on(verb::update, "notice", [](const request&, json_writer&) {});
    node.open("localization");
    node.on(verb::bind, "lane", [](const request& r, json_writer&) {
        if (r.parameters().size() != 1 || r.parameter(0) != "left") {
            throw error(errc::bad_request, "there is only lane/left");
        }
    });
}

void conversation::add_later_tasks() {
    node_->on_later(verb::delegate, "work");
    node_->on_later(verb::pull, "slow");
    node_->on_later(verb::push, "store");
    node_->on_later(verb::update, "survey");
}

test_link& conversation::link(char name) {
    make_node();
    auto& made = links_[name];
    if (!made) {
        made = std::make_unique<test_link>(*node_);
    }
    return *made;
}

// -- steps ---------------------------------------------------------------------------------------------------------

void conversation::perform(std::string_view step) {
    char name = 'a';
    if (!step.empty() && step.front() >= 'a' && step.front() <= 'z') {
        name = step.front();
        step.remove_prefix(1);
    }
    if (step.starts_with(">> ")) {
        link(name).session().on_line(unescaped(step.substr(3)), node_->clock.now());
    } else if (step.starts_with("> ")) {
        link(name).session().on_line(step.substr(2), node_->clock.now());
    } else if (step.starts_with("@ ")) {
        happen(name, step.substr(2));
    } else {
        throw script_error{"a step begins with '> ', '>> ' or '@ '"};
    }
    if (node_) {
        collect();
        node_->drain();
        collect();
        collect_states();
    }
}

void conversation::happen(char name, std::string_view rest) {
    const auto what = word(rest);
    if (what == "limits") {
        if (node_) {
            throw script_error{"limits come first"};
        }
        while (!rest.empty()) {
            set_limit(word(rest));
        }
        return;
    }
    make_node();
    if (what == "pass") {
        node_->pass(std::chrono::milliseconds{number(rest, longest_pass)});
    } else if (what == "publish") {
        const auto path = word(rest);
        noun("car1:" + std::string{path});
        const auto body = json(rest);
        try {
            node_->publish(path, body);
        } catch (const error& refused) {
            throw script_error{"this cannot be published: " + refused.message()};
        }
    } else if (what == "done" || what == "fail" || what == "progress") {
        on_handler(what, rest);
    } else {
        on_link(name, what, rest);
    }
}

void conversation::set_limit(std::string_view assignment) {
    protocol::adverb a;
    if (!protocol::split_adverb(assignment, a)) {
        throw script_error{"a limit is set by NAME=NUMBER"};
    }
    const std::array<std::pair<std::string_view, std::size_t*>, 6> known{{{"line", &bounds.line},
                                                                          {"depth", &bounds.depth},
                                                                          {"in_flight", &bounds.in_flight},
                                                                          {"bindings", &bounds.bindings},
                                                                          {"nouns", &bounds.nouns},
                                                                          {"running", &bounds.running}}};
    const auto found = std::find_if(known.begin(), known.end(), [&](const auto& k) { return k.first == a.key; });
    if (found == known.end()) {
        throw script_error{"there is no limit '" + std::string{a.key} + "'"};
    }
    *found->second = number(a.value, longest_text);
}

void conversation::on_handler(std::string_view what, std::string_view rest) {
    const auto key = word(rest);
    const auto found = std::find_if(node_->started.begin(), node_->started.end(), [&](const auto& running) {
        return !running->parameters.empty() && running->parameters.front() == key;
    });
    if (found == node_->started.end()) {
        throw script_error{"no handler of '" + std::string{key} + "' runs"};
    }
    const auto running = *found;
    if (what == "progress") {
        const auto percent = number(word(rest), 100);
        running->call->progress(static_cast<double>(percent) / 100, json(rest));
        return;
    }
    node_->started.erase(found);
    if (what == "done") {
        running->call->done(json(rest));
    } else {
        running->call->fail({.code = errc_from_wire(word(rest)), .message = std::string{rest}});
    }
}

void conversation::on_link(char name, std::string_view what, std::string_view rest) {
    auto& at = link(name);
    if (what == "end") {
        at.half_close();
    } else if (what == "lost") {
        at.reset();
    } else if (what == "overlong") {
        at.overlong(rest);
    } else if (what == "full") {
        at.takes = false;
    } else if (what == "room") {
        at.make_writable();
    } else if (what == "ask") {
        ask(name, rest);
    } else if (what == "cancel") {
        at.session().asking().cancel(number(rest, protocol::max_id));
    } else if (what == "follow") {
        follow(name, rest);
    } else {
        throw script_error{"there is no step '@ " + std::string{what} + "'"};
    }
}

/// `@ ask ID VERB NOUN [deadline=MS] [progress=yes] [JSON]`
void conversation::ask(char name, std::string_view rest) {
    const auto id = number(word(rest), protocol::max_id);
    protocol::outgoing_request request{.verb = verb_named(word(rest)), .noun = word(rest), .id = id};
    noun(request.noun);
    auto limit = std::uint64_t{protocol::default_deadline(request.verb)};
    if (rest.starts_with("deadline=")) {
        limit = number(word(rest).substr(9), longest_pass);
    }
    core::outbound::progress_function progress;
    if (rest.starts_with("progress=yes")) {
        word(rest);
        progress = [this, id](double fraction, std::string_view body) {
            collect();
            told_.push_back("= " + std::to_string(id) + " progress " +
                            std::to_string(static_cast<int>(fraction * 100)) + " " + std::string{body});
        };
    }
    const auto body = json(rest);
    request.body = body;
    if (!body.empty() && (request.verb == verb::pull || request.verb == verb::bind)) {
        throw script_error{"this verb takes no body"};
    }
    const auto known = asked_.find(id);
    if (id == 0 || (known != asked_.end() && known->second == told_reply::state::waiting)) {
        throw script_error{"the id is in flight"};
    }
    auto& at = link(name);
    const auto now = node_->clock.now();
    detail::pending_ptr operation{new told_reply(id, asked_[id], [this](const std::string& what) {
        collect();
        told_.push_back("= " + what);
    })};
    at.session().asking().send(request, now + std::chrono::milliseconds{limit}, now, std::move(operation),
                               std::move(progress));
}

/// `@ follow NOUN [every]`
void conversation::follow(char name, std::string_view rest) {
    const auto parts = noun(word(rest));
    auto feed = std::make_unique<told_feed>(std::string{parts.target}, std::string{parts.path}, rest == "every",
                                            [this](const std::string& what) {
                                                collect();
                                                told_.push_back("= " + what);
                                            });
    if (!link(name).session().bound().add(*feed)) {
        throw script_error{"it is followed already"};
    }
    feeds_.push_back(std::move(feed));
}

// -- results -------------------------------------------------------------------------------------------------------

void conversation::collect() {
    for (auto& [name, at] : links_) {
        for (auto& line : at->take_lines()) {
            told_.push_back(name_on(name) + "< " + std::move(line));
        }
    }
}

void conversation::collect_states() {
    for (auto& [name, at] : links_) {
        auto& known = seen_[name];
        const auto tell = [&, on = name_on(name)](std::string_view what) {
            told_.push_back(on + "= " + std::string{what});
        };
        if (at->paused != known.paused) {
            tell(at->paused ? "pause" : "go on");
        }
        for (; known.finishes < at->finishes; ++known.finishes) {
            tell("finish");
        }
        for (; known.closes < at->closes; ++known.closes) {
            tell("close");
        }
        known.paused = at->paused;
    }
    for (const auto& running : node_->started) {
        if (running->stopped) {
            told_.push_back("= stopped " + (running->parameters.empty() ? "" : running->parameters.front()));
        }
    }
    std::erase_if(node_->started, [](const auto& running) { return running->stopped; });
}

} // namespace cles::test

// SPDX-License-Identifier: BSL-1.0
// Datagrams from several sources, arbitrary and repeated ones, while time passes, the node publishes, its handlers
// reply late and it sends requests itself. One step a line:
//
//     a PUSH car1:store id=7 {"x":1}   source a (to d) sends this; \n is an LF, \\ a backslash
//     +250                             so many milliseconds go by
//     =fix {"x":1}                     the node publishes
//     !{"x":1}                         the handler that has run the longest answers
//     ~busy                            the same, with a failure
//     ?a                               the node asks source a
//
// For every input: each output is a message within its size, there is no reply without a request, no effect occurs
// twice within a minute, a repetition gets the same reply, the node's requests complete once and in time, and without
// activity nothing is kept.
#include <cles/error.hpp>
#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "node/session/datagram_rules.hpp"
#include "node/session/link_monitor.hpp"
#include "protocol/grammar.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "support/recording_line_sink.hpp"
#include "support/session_fixture.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace cles::fuzz {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t most_steps = 200;
constexpr std::size_t deep = 64;
constexpr std::uint64_t longest_pass = 200'000;
constexpr std::chrono::seconds asked_for{2};

// Small, so that a short script reaches them.
limits small_limits() {
    limits bounds;
    bounds.depth = 8;
    bounds.in_flight = 4;
    bounds.bindings = 3;
    bounds.nouns = 3;
    bounds.running = 6;
    bounds.binding_bytes = 1000;
    bounds.remembered = 8000;
    return bounds;
}

/// A request of the node itself: completes once, by its deadline.
class asked final : public detail::pending {
  public:
    asked(test::test_node& node, std::size_t& open) : node_(node), open_(open), due_(node.clock.now() + asked_for) {
        ++open_;
    }
    verdict offer(std::string_view json) override {
        if (!is_valid_json(json, deep)) {
            return verdict::malformed;
        }
        end();
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override { end(); }
    void discard() noexcept override { delete this; }

  private:
    ~asked() { --open_; }
    void end() {
        require(node_.clock.now() <= due_, "a request ends in time");
        delete this;
    }

    test::test_node& node_;
    std::size_t& open_;
    time_point due_;
};

/// A source of datagrams as the node sees it.
class source final : public test::recording_line_sink, public core::subscriber, private core::link_monitor::owner {
  public:
    source(test::test_node& node, char name)
        : recording_line_sink(protocol::datagram_bytes),
          node_(node), peer_{.transport = "udp", .address = "udp://192.0.2.1:" + std::to_string(1000 + name)},
          session_(node.host, *this, *this, peer_),
          output_(*node.host, protocol::datagram_bytes, name == 'd' ? peer_.address : std::string{}, 28),
          life_(*this, node.host->deadlines, node.host->bounds, node.clock.now()) {
        life_.expect_datagrams();
    }

    void receive(std::string_view datagram) {
        life_.on_line(node_.clock.now());
        if (datagram.size() > protocol::datagram_bytes) {
            session_.on_overlong(datagram.substr(0, protocol::datagram_bytes));
        } else {
            session_.on_line(datagram, node_.clock.now());
        }
    }
    std::string take_limited() {
        turn();
        output_.limit(output(), node_.clock.now());
        return take();
    }
    [[nodiscard]] core::session& session() { return session_; }
    [[nodiscard]] bool gone() const { return gone_; }

    void turn() override {
        if (session_.serving().has_more()) {
            session_.serving().serve_more(node_.clock.now());
        }
    }
    [[nodiscard]] bool takes_updates() const override { return true; }
    void put_updates(std::string_view lines) override { output_.append_updates(output(), lines); }

    std::size_t asked = 0;
    std::size_t answered = 0;

  private:
    [[nodiscard]] bool is_idle() const override { return session_.is_idle(); }
    void on_silence() override { gone_ = true; }
    void on_probe() override {}
    void evict() override {}

    test::test_node& node_;
    identity peer_;
    core::session session_;
    core::datagram_output output_;
    core::link_monitor life_;
    bool gone_ = false;
};

class watched_node {
  public:
    watched_node() : node_(small_limits()) {
        node_.on(verb::pull, "speed", R"({"v":27.5})");
        node_.on(verb::pull, "text", [](const request& r, json_writer& w) {
            w.value(std::string(std::min<std::size_t>(r.parameter<std::size_t>(0), 3000), 'x'));
        });
        node_.on(verb::push, "store", [this](const request& r, json_writer& w) {
            note_effect();
            std::string body;
            append_compact_json(r.body(), body);
            w.raw(body);
        });
        node_.on(verb::update, "notice", [this](const request&, json_writer&) { note_effect(); });
        node_.on_later(verb::delegate, "work");
        node_.on_later(verb::push, "keep");
        node_.on_later(verb::pull, "slow");
        node_.on_later(verb::update, "survey");
        node_.open("fix");
    }
    ~watched_node() {
        sources_.clear();
        node_.started.clear();
    }

    void step(std::string_view line) {
        if (line.empty()) {
            return;
        }
        const auto rest = line.substr(1);
        switch (line.front()) {
        case 'a':
        case 'b':
        case 'c':
        case 'd': receive(line.front(), unescaped(rest.substr(rest.starts_with(' ') ? 1 : 0))); break;
        case '+': pass(milliseconds{protocol::number_between(rest, 0, longest_pass).value_or(0)}); break;
        case '=': publish(rest); break;
        case '!':
        case '~': answer(line.front() == '!', rest); break;
        case '?': ask(rest.empty() ? 'a' : rest.front()); break;
        default: return;
        }
        settle();
    }

    /// Advances the time until nothing is kept any more.
    void end() {
        for (const auto& running : std::exchange(node_.started, {})) {
            running->call->done("{}");
        }
        settle();
        for (int minutes = 0; minutes < 10; ++minutes) {
            pass(std::chrono::minutes{1});
            settle();
        }
        require(sources_.empty(), "a source that is quiet is let go of");
        require(node_.host->remembered.used == 0, "what was remembered is forgotten");
        require(node_.host->deadlines.size() == 0, "no deadline is left");
        require(node_.counts().handlers_running == 0, "no handler is left");
        require(asks_ == 0, "what was asked has ended");
    }

  private:
    struct effect {
        time_point at{};
        std::string reply{};
    };

    static std::string unescaped(std::string_view text) {
        std::string out;
        for (std::size_t i = 0; i < text.size(); ++i) {
            if (text[i] == '\\' && i + 1 < text.size()) {
                ++i;
                out.push_back(text[i] == 'n' ? '\n' : text[i]);
            } else {
                out.push_back(text[i]);
            }
        }
        return out;
    }

    // Each deadline expires at its time, as with a timer.
    void pass(milliseconds span) {
        const auto end = node_.clock.now() + span;
        auto& deadlines = node_.host->deadlines;
        for (auto next = deadlines.next(); next && *next <= end; next = deadlines.next()) {
            node_.clock.advance(std::max(*next - node_.clock.now(), std::chrono::nanoseconds{0}));
            deadlines.expire(node_.clock.now());
            settle();
        }
        node_.clock.advance(end - node_.clock.now());
    }

    source& from(char name) {
        auto& made = sources_[name];
        if (!made) {
            made = std::make_unique<source>(node_, name);
        }
        return *made;
    }

    void receive(char name, std::string datagram) {
        if (datagram.ends_with('\n')) {
            datagram.pop_back();
        }
        if (datagram.empty()) {
            return;
        }
        auto& s = from(name);
        ++s.asked;
        now_ = {name, std::string{protocol::trim(datagram)}};
        ran_ = false;
        s.receive(datagram);
        const auto out = s.output();
        if (ran_) {
            effects_[now_].reply = out;
        } else if (const auto known = effects_.find(now_); known != effects_.end() && repeats(known->second)) {
            require(out == known->second.reply, "a repeat gets the same answer", out);
        }
    }
    [[nodiscard]] bool repeats(const effect& e) const { return node_.clock.now() - e.at < core::dedup::memory; }

    void note_effect() {
        ran_ = true;
        const auto [known, is_new] = effects_.try_emplace(now_);
        require(is_new || !repeats(known->second), "no effect comes twice", now_.second);
        known->second.at = node_.clock.now();
    }

    void publish(std::string_view rest) {
        const auto space = std::min(rest.find(' '), rest.size());
        const auto body = rest.substr(std::min(space + 1, rest.size()));
        protocol::noun_view noun;
        std::string why;
        const auto whole = "car1:" + std::string{rest.substr(0, space)};
        if (!protocol::parse_noun(whole, noun, why) || noun.task == "cles" || !is_valid_json(body)) {
            return;
        }
        std::string compact;
        append_compact_json(body, compact);
        try {
            node_.publish(protocol::canonical_path(noun, why), compact);
        } catch (const error&) { // too large, or too many
        }
    }

    void answer(bool well, std::string_view rest) {
        if (node_.started.empty()) {
            return;
        }
        const auto first = node_.started.front();
        node_.started.erase(node_.started.begin());
        if (!well) {
            first->call->fail({.code = errc_from_wire(rest), .message = "as it was asked to"});
        } else if (is_valid_json(rest, small_limits().depth)) {
            std::string compact;
            append_compact_json(rest, compact);
            first->call->progress(0.5, compact);
            first->call->done(compact);
        } else {
            first->call->done("{}");
        }
    }

    void ask(char name) {
        if (name < 'a' || name > 'd' || asks_ >= 8) {
            return;
        }
        const auto now = node_.clock.now();
        from(name).session().asking().send({.verb = verb::push, .noun = "car2:store", .id = node_.host->next_id++},
                                           now + asked_for, now, detail::pending_ptr{new asked{node_, asks_}});
    }

    void settle() {
        node_.drain();
        for (auto at = sources_.begin(); at != sources_.end();) {
            heed(*at->second);
            at = at->second->gone() ? sources_.erase(at) : std::next(at);
        }
        std::erase_if(node_.started, [](const auto& running) { return running->call->ended(); });
        require(node_.counts().handlers_running <= node_.host->bounds.running, "handlers are no more than may run");
        require(node_.host->remembered.used <=
                    node_.host->bounds.remembered + node_.host->bounds.running * 2 * protocol::datagram_bytes,
                "what is remembered is bounded");
        require(node_.host->deadlines.size() < 100, "deadlines are no more than what waits");
    }

    void heed(source& s) {
        const auto out = s.take_limited();
        for (std::size_t at = 0; at < out.size();) {
            const auto end = out.find('\n', at);
            require(end != std::string::npos, "a message ends", out);
            require(end + 1 - at <= protocol::datagram_bytes, "a message fits a datagram", out);
            heed_line(s, std::string_view{out}.substr(at, end - at));
            at = end + 1;
        }
    }

    static void heed_line(source& s, std::string_view line) {
        if (!protocol::is_reply(line)) {
            protocol::request_line request;
            protocol::malformed_request why;
            require(protocol::parse_request(line, request, why), "a request can be read", line);
            return;
        }
        protocol::reply_line reply;
        require(protocol::parse_reply(line, reply), "a reply can be read", line);
        require(is_valid_json(reply.body, deep), "its body is JSON", line);
        if (!reply.progress) {
            require(++s.answered <= s.asked, "nothing is answered that was not asked", line);
        }
    }

    test::test_node node_;
    std::map<char, std::unique_ptr<source>> sources_;
    std::map<std::pair<char, std::string>, effect> effects_;
    std::pair<char, std::string> now_;
    std::size_t asks_ = 0;
    bool ran_ = false;
};

} // namespace

void run(std::string_view input) {
    watched_node watched;
    for (std::size_t steps = 0; !input.empty() && steps < most_steps; ++steps) {
        const auto end = std::min(input.find('\n'), input.size());
        watched.step(input.substr(0, end));
        input.remove_prefix(end == input.size() ? end : end + 1);
    }
    watched.end();
}

} // namespace cles::fuzz

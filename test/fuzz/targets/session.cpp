// SPDX-License-Identifier: BSL-1.0
// A conversation: a script like those in test/golden, of which only the steps count. For any steps, in any order and at
// any time: the node's output is well-formed, no more than was requested, and within its limits.
#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "support/conversation.hpp"

#include <algorithm>
#include <map>
#include <string>

namespace cles::fuzz {
namespace {

constexpr std::size_t most_steps = 150;
constexpr std::size_t deep = 64; // deeper than any body that a handler returns

// Small, so that a short script reaches them.
limits small_limits() {
    limits bounds;
    bounds.line = 400;
    bounds.depth = 8;
    bounds.in_flight = 4;
    bounds.bindings = 3;
    bounds.nouns = 3;
    bounds.running = 6;
    bounds.waiting = 600;
    bounds.binding_bytes = 1000;
    return bounds;
}

class watched_conversation {
  public:
    watched_conversation() { talk_.bounds = small_limits(); }

    void step(std::string_view line) {
        const bool named = line.front() >= 'a' && line.front() <= 'z';
        auto& link = links_[named ? line.front() : 'a'];
        const auto what = line.substr(named ? 1 : 0);
        const bool ends = what.starts_with("@ overlong") || what.starts_with("@ end");
        const bool comes = what.starts_with('>') || ends;
        // A transport delivers nothing while it is paused, nor after the end (cles/link.hpp).
        if (what.starts_with("@ limits") || link.closed || (comes && (link.paused || link.ended))) {
            return;
        }
        link.ended = link.ended || ends;
        link.asked += comes ? 1 : 0;
        try {
            talk_.perform(line);
        } catch (const test::script_error&) {
            // Not every script is valid.
        }
        link.closed = link.closed || what.starts_with("@ lost");
        for (const auto& event : talk_.take()) {
            const bool elsewhere = event.front() >= 'a' && event.front() <= 'z';
            heed(links_[elsewhere ? event.front() : 'a'], std::string_view{event}.substr(elsewhere ? 1 : 0));
        }
        check_bounds();
    }

  private:
    struct link_state {
        std::size_t asked = 0;
        std::size_t answered = 0;
        bool paused = false;
        bool ended = false; // by the peer
        bool finished = false;
        bool closed = false;
    };

    void heed(link_state& link, std::string_view event) {
        if (event.starts_with("< ")) {
            heed_line(link, event.substr(2));
        } else if (event == "= finish") {
            require(!link.finished, "a link is finished once");
            link.finished = true;
        } else if (event == "= close") {
            link.closed = true;
        } else if (event == "= pause" || event == "= go on") {
            link.paused = event == "= pause";
        }
    }

    void heed_line(link_state& link, std::string_view line) {
        require(!link.closed, "a closed link is left alone", line);
        require(!line.ends_with(" <no LF>"), "a line ends", line);
        if (!protocol::is_reply(line)) {
            protocol::request_line request;
            protocol::malformed_request why;
            require(protocol::parse_request(line, request, why), "a request can be read", line);
            require(request.body.empty() || is_valid_json(request.body, deep), "its body is JSON", line);
            require(!request.is_update() || line.size() <= talk_.bounds.line, "an update fits a line", line);
            return;
        }
        protocol::reply_line reply;
        require(protocol::parse_reply(line, reply), "a reply can be read", line);
        require(is_valid_json(reply.body, deep), "its body is JSON", line);
        require(line.size() <= talk_.bounds.line, "a reply fits a line", line);
        std::string compact;
        append_compact_json(reply.body, compact);
        require(compact == reply.body, "a reply has no white space", line);
        protocol::failure why;
        require(!protocol::is_failure(reply.body) || reply.progress || protocol::parse_failure(reply.body, why),
                "a failure can be read", line);
        if (!reply.progress) {
            require(!link.finished, "a finished link gives no answers", line);
            require(++link.answered <= link.asked, "nothing is answered that was not asked", line);
        }
    }

    void check_bounds() {
        if (talk_.node() == nullptr) {
            return;
        }
        const auto& bounds = talk_.bounds;
        require(talk_.node()->counts().handlers_running <= bounds.running, "handlers are no more than may run");
        require(talk_.node()->host->deadlines.size() < 1000, "deadlines are no more than what waits");
        for (const auto& [name, link] : talk_.links()) {
            // What waits for its turn may already be a reply, which counts with its bytes.
            require(link->session().serving().in_flight() <= bounds.in_flight + bounds.waiting / 2 + 2,
                    "what is in flight is bounded");
            require(link->session().serving().bindings() <= bounds.bindings, "bindings are bounded");
        }
    }

    test::conversation talk_;
    std::map<char, link_state> links_;
};

} // namespace

void run(std::string_view input) {
    watched_conversation watched;
    for (std::size_t steps = 0; !input.empty() && steps < most_steps;) {
        const auto end = std::min(input.find('\n'), input.size());
        const auto line = input.substr(0, end);
        input.remove_prefix(end == input.size() ? end : end + 1);
        if (test::conversation::is_step(line)) {
            watched.step(line);
            ++steps;
        }
    }
}

} // namespace cles::fuzz

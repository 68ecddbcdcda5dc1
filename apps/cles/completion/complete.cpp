// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "completion/candidates.hpp"
#include "completion/cursor.hpp"
#include "completion/live_candidates.hpp"
#include "discovery/host.hpp"
#include "options/addresses.hpp"
#include "output/errors.hpp"
#include "output/terminal.hpp"
#ifdef CLES_SECURITY
#include "trust/member_candidates.hpp"
#endif

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <string_view>
#include <utility>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr auto budget = 80ms; // of 100 ms: the rest is for the shell, and for starting this program

using candidates = std::vector<candidate>;

// Names come from other nodes: words that a shell could interpret are not offered.
bool is_safe_character(char c) noexcept {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view{"_-.~+%/:@=,"}.find(c) != std::string_view::npos;
}
bool is_safe(const std::string& text) { return std::all_of(text.begin(), text.end(), is_safe_character); }

bool is_json(const std::string& text) noexcept { return text.starts_with('{') || text.starts_with('['); }

// The scripts quote JSON, so only what ends a quotation, or has a meaning in it, is dangerous.
bool is_safe_json(const std::string& text) {
    return is_json(text) && std::all_of(text.begin(), text.end(), [](char c) {
               return is_safe_character(c) || std::string_view{"{}[]\" "}.find(c) != std::string_view::npos;
           });
}

// --at, --peer and --multicast among the words that were typed.
address_book addresses_in(std::vector<std::string> words) {
    address_book addresses;
    CLI::App parser;
    parser.set_help_flag();
    parser.allow_extras();
    addresses.add_options(parser);
    std::reverse(words.begin(), words.end()); // the order that CLI11 expects
    parser.parse(std::move(words));
    return addresses;
}

/// Asks the network for candidates of the value that is being typed.
class live_search {
  public:
    explicit live_search(const cursor& cursor) : cursor_(cursor), addresses_(addresses_in(cursor.words)) {}

    candidates run() {
        const auto name = cursor_.option->get_name();
        const std::string kind = cursor_.option->get_type_name();
#ifdef CLES_SECURITY
        if (kind.starts_with("MEMBER")) {
            return member_candidates(cursor_.words, kind == "MEMBER" ? "" : ":");
        }
#endif
        if (name == "noun") {
            return nouns();
        }
        if (kind == "JSON") {
            return cursor_.typed.empty() || is_json(cursor_.typed) ? bodies() : candidates{};
        }
        if (name == "node" || name == "target") {
            return names("");
        }
        if (kind == "URL") {
            return urls();
        }
        if (kind == "NAME=URL") {
            return cursor_.typed.find('=') == std::string::npos ? names("=") : candidates{};
        }
        return {};
    }

  private:
    candidates nouns() {
        const auto colon = cursor_.typed.find(':');
        if (cursor_.command->get_name() == "publish") { // of a node that does not run yet
            return {};
        }
        if (colon == std::string::npos) {
            auto out = names(":");
            out.push_back({"self:", "the node at the address of --at"});
            if (!binds()) {
                out.push_back({"any:", "a node that offers the task"});
            }
            out.push_back({"all:", "all nodes that offer the task"});
            return out;
        }
        const auto node = cursor_.typed.substr(0, colon);
        const auto command = cursor_.command->get_name();
        const auto verb = binds() ? cles::verb::bind : cles::verb_from(command == "trace" ? traced() : command);
        if (!verb || (node != "self" && has_no_nodes())) {
            return {};
        }
        return ask([&](client& requester) { return live_nouns(requester, addresses_, node, *verb, until_); });
    }

    [[nodiscard]] bool binds() const {
        const auto command = cursor_.command->get_name();
        return command == "bind" || command == "hz" || command == "sniff";
    }

    /// What the node of the noun takes.
    candidates bodies() {
        const auto verb = cles::verb_from(cursor_.command->get_name());
        const auto noun = std::find_if(cursor_.words.begin(), cursor_.words.end(), [](const std::string& word) {
            return word.find(':') != std::string::npos && word.find("://") == std::string::npos && is_safe(word);
        });
        if (!verb || noun == cursor_.words.end() || noun->starts_with("any:") || noun->starts_with("all:") ||
            (!noun->starts_with("self:") && has_no_nodes())) {
            return {};
        }
        return ask([&](client& requester) { return live_bodies(requester, *noun, *verb, until_); });
    }

    /// The verb in `cles trace VERB NOUN`.
    [[nodiscard]] std::string traced() const {
        const auto& words = cursor_.words;
        const auto found =
            std::find_if(words.begin(), words.end(), [](const auto& word) { return cles::verb_from(word); });
        return found == words.end() ? std::string{} : *found;
    }

    candidates names(const std::string& suffix) {
        if (has_no_nodes()) {
            return {};
        }
        auto out = ask([&](client& requester) { return live_names(requester, addresses_, until_); });
        for (auto& each : out) {
            each.text += suffix;
        }
        return out;
    }

    candidates urls() {
        candidates out{{std::string{addresses_.default_node()}, "the default address of a node"}};
        if (!has_no_nodes()) {
            auto more = ask([&](client& requester) { return live_urls(requester, addresses_, until_); });
            std::move(more.begin(), more.end(), std::back_inserter(out));
        }
        return out;
    }

    [[nodiscard]] bool has_no_nodes() const {
        return addresses_.finds_by_name() && has_no_listener(addresses_.group());
    }

    template <class Question>
    candidates ask(Question question) {
        candidates out;
        client requester{addresses_, 0};
        requester.run(store(question(requester), out));
        return out;
    }

    static asio::awaitable<void> store(asio::awaitable<candidates> answer, candidates& out) {
        auto found = co_await std::move(answer);
        out = std::move(found);
    }

    const cursor& cursor_;
    const address_book addresses_;
    const steady::time_point until_ = steady::now() + budget;
};

candidates candidates_at(CLI::App& app, const cursor& cursor) {
    switch (cursor.what) {
    case cursor::at::command: return commands_of(*cursor.command);
    case cursor::at::option: return options_at(app, cursor);
    case cursor::at::value: break;
    case cursor::at::nothing: return {};
    }
    auto out = values_at(cursor);
    auto live = live_search{cursor}.run();
    std::move(live.begin(), live.end(), std::back_inserter(out));
    return out;
}

} // namespace

int complete(CLI::App& app, std::vector<std::string> words) {
    try {
        const auto at = find_cursor(app, std::move(words));
        std::string text;
        for (const auto& each : candidates_at(app, at)) {
            // After "--data=", the scripts would not quote it.
            const bool is_body = at.before.empty() && is_safe_json(each.text);
            if (each.text.starts_with(at.typed) && (is_body || is_safe(each.text))) {
                text.append(at.before).append(each.text).append("\t").append(printable(each.description)).append("\n");
            }
        }
        write_output(text);
    } catch (...) { // messages would disturb the line that is being typed
        return exit_code::success;
    }
    return exit_code::success;
}

} // namespace tool

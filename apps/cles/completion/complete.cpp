// SPDX-License-Identifier: BSL-1.0
#include "completion/complete.hpp"

#include "client/client.hpp"
#include "completion/candidates.hpp"
#include "completion/cursor.hpp"
#include "completion/live_candidates.hpp"
#include "discovery/group_listeners.hpp"
#include "options/addresses.hpp"
#include "output/exit_code.hpp"
#include "output/output.hpp"
#include "output/terminal.hpp"

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

constexpr auto budget = 80ms; // of 100: the rest is for the shell, and for starting this program

using candidates = std::vector<candidate>;

// --at, --peer and --multicast among the words typed already.
address_book addresses_in(std::vector<std::string> words) {
    address_book addresses;
    CLI::App only_those;
    only_those.set_help_flag();
    only_those.allow_extras();
    addresses.add_options(only_those);
    std::reverse(words.begin(), words.end()); // as CLI11 takes them
    only_those.parse(std::move(words));
    return addresses;
}

/// Asks the network for the value that is being typed.
class live_search {
  public:
    explicit live_search(const cursor& here) : here_(here), addresses_(addresses_in(here.words)) {}

    candidates run() {
        const auto name = here_.option->get_name();
        const std::string kind = here_.option->get_type_name();
        if (name == "noun") {
            return nouns();
        }
        if (name == "node" || name == "target") {
            return names("");
        }
        if (kind == "URL") {
            return urls();
        }
        if (kind == "NAME=URL") {
            return here_.typed.find('=') == std::string::npos ? names("=") : candidates{};
        }
        return {};
    }

  private:
    candidates nouns() {
        const auto colon = here_.typed.find(':');
        if (colon == std::string::npos) {
            auto out = names(":");
            out.push_back({"self:", "the node at the address that is asked"});
            out.push_back({"any:", "one that offers the task"});
            out.push_back({"all:", "all that offer the task"});
            return out;
        }
        const auto node = here_.typed.substr(0, colon);
        const auto command = here_.command->get_name();
        const auto verb = command == "hz" ? cles::verb::bind : cles::verb_from(command);
        if (!verb || (node != "self" && is_nobody_there())) {
            return {};
        }
        return ask([&](client& asker) { return live_nouns(asker, addresses_, node, *verb, until_); });
    }

    candidates names(const std::string& behind) {
        if (is_nobody_there()) {
            return {};
        }
        auto out = ask([&](client& asker) { return live_names(asker, addresses_, until_); });
        for (auto& each : out) {
            each.text += behind;
        }
        return out;
    }

    candidates urls() {
        candidates out{{std::string{default_url}, "where a node listens unless something else is said"}};
        if (!is_nobody_there()) {
            auto more = ask([&](client& asker) { return live_urls(asker, addresses_, until_); });
            std::move(more.begin(), more.end(), std::back_inserter(out));
        }
        return out;
    }

    [[nodiscard]] bool is_nobody_there() const {
        return addresses_.finds_by_name() && nobody_listens(addresses_.group());
    }

    template <class Question>
    candidates ask(Question question) {
        candidates out;
        client asker{addresses_, 0};
        asker.run(keep(question(asker), out));
        return out;
    }

    static asio::awaitable<void> keep(asio::awaitable<candidates> answer, candidates& out) {
        auto found = co_await std::move(answer);
        out = std::move(found);
    }

    const cursor& here_;
    const address_book addresses_;
    const steady::time_point until_ = steady::now() + budget;
};

candidates candidates_at(CLI::App& app, const cursor& here) {
    switch (here.what) {
    case cursor::at::command: return commands_of(app);
    case cursor::at::option: return options_at(app, here);
    case cursor::at::value: break;
    case cursor::at::nothing: return {};
    }
    auto out = values_at(here);
    auto live = live_search{here}.run();
    std::move(live.begin(), live.end(), std::back_inserter(out));
    return out;
}

// Names come from other nodes, and what is typed is run: nothing is offered that a shell would not take as it stands.
bool is_plain(const std::string& text) {
    return std::all_of(text.begin(), text.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               std::string_view{"_-.~+%/:@=,"}.find(c) != std::string_view::npos;
    });
}

} // namespace

int complete(CLI::App& app, std::vector<std::string> words) {
    try {
        const auto here = find_cursor(app, std::move(words));
        std::string text;
        for (const auto& each : candidates_at(app, here)) {
            if (each.text.starts_with(here.typed) && is_plain(each.text)) {
                text.append(here.before).append(each.text).append("\t").append(printable(each.about)).append("\n");
            }
        }
        write_output(text);
    } catch (...) { // words would land in the middle of what is being typed
        return exit_code::success;
    }
    return exit_code::success;
}

} // namespace tool

// SPDX-License-Identifier: BSL-1.0
// A plugin in C++ that uses everything that a plugin may use, and refuses to start if requested.
#include <cles/coroutine_handler.hpp>
#include <cles/job_feed.hpp>
#include <cles/plugin.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/describe/class.hpp>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

struct sound_settings {
    std::optional<int> number;
    std::optional<std::string> refuse;

    void check() const {
        if (number.value_or(0) > 1000) {
            throw cles::setting_error("number", "number: 1000 at most");
        }
    }
};
BOOST_DESCRIBE_STRUCT(sound_settings, (), (number, refuse))

namespace {

struct sum {
    double a = 0, b = 0;
};
BOOST_DESCRIBE_STRUCT(sum, (), (a, b))

// A thread that exists as long as the handlers that own it.
class worker {
  public:
    ~worker() {
        if (thread_.joinable()) {
            thread_.join();
        }
    }
    template <class F>
    void run(F f) {
        if (thread_.joinable()) {
            thread_.join();
        }
        thread_ = std::thread{std::move(f)};
    }

  private:
    std::thread thread_;
};

// Adds up what is published, until that is 0.
void add_up(const cles::responder& answer, const cles::job_feed& from, int sum) {
    from.next([answer, from, sum](boost::system::error_code code, const cles::job_event& event) {
        if (code) {
            answer.fail(static_cast<cles::errc>(code.value()), event.text);
        } else if (const int value = event.as<int>(); value != 0) {
            add_up(answer, from, sum + value);
        } else {
            answer.done(sum);
        }
    });
}

void refuse(cles::registrar& to, const std::string& how) {
    if (how == "error") {
        throw cles::error(cles::errc::failed, "no device there");
    }
    if (how == "anything") {
        throw 7;
    }
    if (how == "coroutine") {
        to.on_pull("later", []() -> boost::asio::awaitable<int> { co_return 7; });
    }
    if (how == "twice") {
        to.on_pull("number", [] { return 8; });
    }
    if (how == "name") {
        to.on_pull("not a name", [] { return 8; });
    }
}

} // namespace

void register_tasks(cles::registrar& to, const sound_settings& wanted) {
    const auto thread = std::make_shared<worker>();
    to.on_pull("number", [number = wanted.number.value_or(42)] { return number; },
               {.description = "A number", .idempotent = true});
    to.on_pull("parameters", [](const cles::request& asked) { return asked.parameter(0).size(); },
               {.parameters = {"text"}, .inline_ok = true});
    to.on_push("guarded", [] { return 1; }, {.must_be_signed = true});
    to.on_push("sum", [](const sum& s) { return s.a + s.b; });
    to.on_push("fails", [](const cles::request&) { throw cles::error(cles::errc::denied, "not you"); });
    to.on_delegate("elsewhere", [thread](const cles::request& asked, const cles::responder& answer) {
        thread->run([asked, answer]() {
            answer.progress(0.25);
            answer.progress(0.5, sum{1, 2});
            answer.log(cles::log_level::info, "half way");
            answer.done(asked.as<sum>());
        });
    });
    to.on_delegate("full", [](const cles::request&, const cles::responder& answer) {
        answer.refuse("the dock is full", std::chrono::milliseconds{250});
    });
    to.on_delegate("dropped", [](const cles::request&, const cles::responder&) {});
    to.on_delegate("dropped_elsewhere",
                   [thread](const cles::request&, const cles::responder& answer) { thread->run([answer] {}); });
    to.on_delegate("until_stopped",
                   [updates = to.make_publisher()](const cles::request&, const cles::responder& answer) {
                       auto kept = answer;
                       kept.on_stop([answer, updates]() {
                           updates.update("stops", answer.stopped());
                           answer.fail(cles::errc::cancelled, "told to");
                       });
                   });
    to.on_bind("stops");
    to.on_delegate("polls", [thread](const cles::request&, const cles::responder& answer) {
        thread->run([answer]() {
            while (!answer.stopped()) {
                std::this_thread::sleep_for(std::chrono::milliseconds{1});
            }
        });
    });
    to.on_delegate("asks", [](const cles::request& asked, const cles::responder& answer) {
        answer.delegate(asked.parameter<std::string>(0) == "pull" ? "PULL self:number" : "DELEGATE self:nobody {}",
                        [answer](boost::system::error_code code, std::string_view json, std::string_view words) {
                            if (code) {
                                answer.fail(static_cast<cles::errc>(code.value()), words);
                            } else {
                                answer.done(cles::json_text{std::string{json}});
                            }
                        });
    });
    to.on_delegate("asks_and_throws", [](const cles::request&, const cles::responder& answer) {
        answer.delegate("PULL self:number", [answer](boost::system::error_code, std::string_view, std::string_view) {
            throw std::runtime_error{"did not like it"};
        });
    });
    to.on_delegate("asks_elsewhere", [thread](const cles::request&, const cles::responder& answer) {
        thread->run([answer]() {
            auto options = cles::call_options{};
            options.on_progress([answer](double part, std::string_view) { answer.progress(part / 2); });
            answer.delegate("DELEGATE self:elsewhere {\"a\":1,\"b\":2}", options,
                            [answer](boost::system::error_code code, std::string_view json, std::string_view) {
                                answer.done(cles::json_text{code ? "null" : std::string{json}});
                            });
        });
    });
    const auto follow = [](const cles::request& asked, const cles::responder& answer) {
        add_up(answer, answer.bind(asked.parameter(0), cles::bind_options{}.keep(16)), 0);
    };
    to.on_delegate("adds_up", follow);
    to.on_delegate("adds_up_inline", follow, {.inline_ok = true});
    to.on_bind("ticks",
               [updates = to.make_publisher()](const cles::request& asked) {
                   if (!asked.parameters().empty()) {
                       throw cles::error(cles::errc::bad_request, "ticks have no parameters");
                   }
                   updates.update("ticks", 1);
               },
               {.inline_ok = true});
    to.on_update("target", [](const cles::request&) {});
    if (wanted.refuse) {
        refuse(to, *wanted.refuse);
    }
}

CLES_PLUGIN("sound", "2.1", register_tasks)

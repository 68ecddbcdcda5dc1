// SPDX-License-Identifier: BSL-1.0
#include "grpc.hpp"
#include "localization.grpc.pb.h"
#include "perf/support/localization.hpp"

#include <optional>
#include <stdexcept>
#include <vector>

namespace cles::perf::peers {
namespace {

constexpr std::size_t awaited_at_once = 128;

/// One of the two calls: its reply, how each side names it.
struct exchange_call {
    using reply = wire::Localization;
    static constexpr auto serve = &wire::Car::AsyncService::RequestPull;
    static ::grpc::Status block(wire::Car::Stub& at, ::grpc::ClientContext& context, reply& into) {
        return at.Pull(&context, {}, &into);
    }
    static auto start(wire::Car::Stub& at, ::grpc::ClientContext& context, ::grpc::CompletionQueue& queue) {
        return at.AsyncPull(&context, {}, &queue);
    }
    static void fill(reply& answer, std::uint64_t number) {
        const auto& value = sample(number);
        answer.set_utc(value.utc);
        answer.set_lat(value.lat);
        answer.set_lon(value.lon);
        answer.set_velocity(value.velocity);
        answer.set_acceleration(value.acceleration);
    }
    static bool is_right(const reply& answer) {
        return is_sample({answer.utc(), answer.lat(), answer.lon(), answer.velocity(), answer.acceleration()});
    }
};

struct task_call {
    using reply = wire::Nothing;
    static constexpr auto serve = &wire::Car::AsyncService::RequestEmpty;
    static ::grpc::Status block(wire::Car::Stub& at, ::grpc::ClientContext& context, reply& into) {
        return at.Empty(&context, {}, &into);
    }
    static auto start(wire::Car::Stub& at, ::grpc::ClientContext& context, ::grpc::CompletionQueue& queue) {
        return at.AsyncEmpty(&context, {}, &queue);
    }
    static void fill(reply&, std::uint64_t) {}
    static bool is_right(const reply&) { return true; }
};

/// A call that the server waits for or answers.
template <class Call>
class served {
  public:
    served(wire::Car::AsyncService& service, ::grpc::ServerCompletionQueue& queue) : service_(service), queue_(queue) {
        await();
    }

    void proceed(std::uint64_t& number) {
        if (answering_) {
            await();
            return;
        }
        answering_ = true;
        Call::fill(reply_, number++);
        writer_->Finish(reply_, ::grpc::Status::OK, this);
    }

  private:
    void await() {
        answering_ = false;
        writer_.reset();
        context_.emplace();
        writer_.emplace(&*context_);
        (service_.*Call::serve)(&*context_, &request_, &*writer_, &queue_, &queue_, this);
    }

    wire::Car::AsyncService& service_;
    ::grpc::ServerCompletionQueue& queue_;
    std::optional<::grpc::ServerContext> context_;
    wire::Nothing request_;
    typename Call::reply reply_;
    std::optional<::grpc::ServerAsyncResponseWriter<typename Call::reply>> writer_;
    bool answering_ = false;
};

template <class Call>
void serve(const std::string& listen, const announce& tell) {
    wire::Car::AsyncService service;
    ::grpc::ServerBuilder builder;
    builder.RegisterService(&service);
    const auto queue = builder.AddCompletionQueue();
    std::string where;
    const auto server = start_grpc(builder, listen, where);
    std::vector<std::unique_ptr<served<Call>>> all;
    for (std::size_t i = 0; i < awaited_at_once; ++i) {
        all.push_back(std::make_unique<served<Call>>(service, *queue));
    }
    tell(where);
    std::uint64_t number = 0;
    void* tag = nullptr;
    bool is_good = false;
    while (queue->Next(&tag, &is_good)) {
        static_cast<served<Call>*>(tag)->proceed(number);
    }
}

/// A call in flight. Its context cannot be used again.
template <class Call>
struct flight {
    std::chrono::steady_clock::time_point began;
    std::optional<::grpc::ClientContext> context;
    typename Call::reply reply;
    ::grpc::Status status;
    std::unique_ptr<::grpc::ClientAsyncResponseReader<typename Call::reply>> reader;
};

template <class Call>
class grpc_caller final : public caller {
  public:
    explicit grpc_caller(const std::string& where) : stub_(own_channel(where)) {}
    ~grpc_caller() override {
        queue_.Shutdown();
        void* tag = nullptr;
        bool is_good = false;
        while (queue_.Next(&tag, &is_good)) {
        }
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        if (in_flight == 1) {
            one_by_one(record, [this] {
                ::grpc::ClientContext context;
                typename Call::reply reply;
                check(Call::block(stub_, context, reply), reply);
            });
            return;
        }
        std::vector<flight<Call>> flights(in_flight);
        auto to_ask = record.remaining();
        for (std::size_t i = 0; i < in_flight && to_ask > 0; ++i, --to_ask) {
            start(flights[i]);
        }
        void* tag = nullptr;
        bool is_good = false;
        while (!record.full() && queue_.Next(&tag, &is_good)) {
            auto& done = *static_cast<flight<Call>*>(tag);
            check(done.status, done.reply);
            record.record(std::chrono::steady_clock::now() - done.began);
            if (to_ask > 0) {
                --to_ask;
                start(done);
            }
        }
    }

  private:
    static void check(const ::grpc::Status& status, const typename Call::reply& reply) {
        if (!status.ok()) {
            throw std::runtime_error("gRPC: " + status.error_message());
        }
        if (!Call::is_right(reply)) {
            throw std::runtime_error("the received values are not those that were sent");
        }
    }

    void start(flight<Call>& next) {
        next.began = std::chrono::steady_clock::now();
        next.reader.reset();
        next.context.emplace();
        next.reader = Call::start(stub_, *next.context, queue_);
        next.reader->Finish(&next.reply, &next.status, &next);
    }

    wire::Car::Stub stub_;
    ::grpc::CompletionQueue queue_;
};

} // namespace

std::unique_ptr<::grpc::Server> start_grpc(::grpc::ServerBuilder& builder, const std::string& listen,
                                           std::string& where) {
    int port = 0;
    builder.AddListeningPort(listen, ::grpc::InsecureServerCredentials(), &port);
    auto server = builder.BuildAndStart();
    if (server == nullptr) {
        throw std::runtime_error("gRPC cannot listen at " + listen);
    }
    where = listen.starts_with("unix") ? listen : "127.0.0.1:" + std::to_string(port);
    return server;
}

std::shared_ptr<::grpc::Channel> own_channel(const std::string& where) {
    ::grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    return ::grpc::CreateCustomChannel(where, ::grpc::InsecureChannelCredentials(), arguments);
}

void serve_calls(call what, const std::string& listen, const announce& tell) {
    if (what == call::exchange) {
        serve<exchange_call>(listen, tell);
    } else {
        serve<task_call>(listen, tell);
    }
}

std::unique_ptr<caller> make_grpc_caller(call what, const std::string& where) {
    if (what == call::exchange) {
        return std::make_unique<grpc_caller<exchange_call>>(where);
    }
    return std::make_unique<grpc_caller<task_call>>(where);
}

} // namespace cles::perf::peers

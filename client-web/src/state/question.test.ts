import { describe, expect, it } from "vitest";
import { FakePlatform, settled } from "./fake_platform";
import { Question } from "./question";

function asker(platform: FakePlatform): Question<number, number> {
  return new Question(platform, { path: "api/v1/double", decode: (text) => JSON.parse(text) as number, gather_ms: 50 });
}

describe("a question", () => {
  it("is asked once for many moves of a slider, with the last of them", async () => {
    const platform = new FakePlatform();
    platform.answer = (_method, _path, body) => ({ status: 200, body: String(2 * (body as number)) });
    const question = asker(platform);
    for (const n of [1, 2, 3]) question.ask(n);
    expect(question.asked.value.phase).toBe("asking");
    await platform.pass(50);
    expect(platform.requests.map(({ body }) => body)).toEqual([3]);
    expect(question.asked.value).toMatchObject({ phase: "answered", answer: 6, question: 3 });
  });

  it("shows an answer that was overtaken, and asks the newest question next", async () => {
    const platform = new FakePlatform();
    const waiting: ((status: number) => void)[] = [];
    platform.answer = (_method, _path, body) =>
      new Promise((resume) => waiting.push((status) => resume({ status, body: String(2 * (body as number)) })));
    const question = asker(platform);
    question.ask(1);
    await platform.pass(50);
    question.ask(2);
    question.ask(3);
    expect(waiting.length).toBe(1);
    waiting[0](200);
    await settled();
    expect(question.asked.value).toMatchObject({ phase: "asking", answer: 2, question: 1 });
    waiting[1](200);
    await settled();
    expect(question.asked.value).toMatchObject({ phase: "answered", answer: 6, question: 3 });
    expect(platform.requests.map(({ body }) => body)).toEqual([1, 3]);
  });

  it("keeps the last answer beside a refusal, a silence, or nonsense, and says which", async () => {
    const platform = new FakePlatform();
    platform.answer = () => ({ status: 200, body: "4" });
    const question = asker(platform);
    question.ask(2);
    await platform.pass(50);
    const problem = { type: "/problems/unreachable", title: "out of reach", status: 422, detail: "arm 1 is too short" };
    platform.answer = () => ({ status: 422, body: JSON.stringify(problem) });
    question.ask(9);
    await platform.pass(50);
    expect(question.asked.value).toEqual({ phase: "refused", answer: 4, question: 2, problem });
    platform.answer = () => {
      throw new Error("nobody answers");
    };
    question.ask(9);
    await platform.pass(50);
    expect(question.asked.value).toMatchObject({ phase: "away", answer: 4, problem: undefined });
    platform.answer = () => ({ status: 200, body: "<html>" });
    question.ask(9);
    await platform.pass(50);
    expect(question.asked.value.phase).toBe("refused");
    expect(question.asked.value.problem?.detail).toContain("not understood");
    platform.answer = () => ({ status: 200, body: "18" });
    question.ask(9);
    await platform.pass(50);
    expect(question.asked.value).toMatchObject({ phase: "answered", answer: 18, problem: undefined });
  });
});

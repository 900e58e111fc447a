/** What a newcomer asks of each number, and a short exact answer: docs/method.md has the long ones. */

export interface Explanation {
  question: string;
  /** A paragraph each. */
  answer: readonly string[];
}

const explained = <Topic extends string>(topics: Record<Topic, Explanation>): Readonly<Record<Topic, Explanation>> =>
  topics;

export const EXPLANATIONS = explained({
  error: {
    question: "What is the error?",
    answer: [
      "How far a flight was from its set point on the average: of a takeoff the mean of |3 m − altitude| over the first 32.6 s, of the F-16 the integral of |reference − pitch|.",
      "Lower is better, and 0 cannot be had: climbing takes time. The reference trajectory by itself scores 0.091 m.",
    ],
  },
  errorSoFar: {
    question: "What is the error so far?",
    answer: [
      "The error of the flight's samples up to now. A takeoff begins 3 m below its set point, so it starts high and falls; only after 32.6 s is it the flight's error.",
    ],
  },
  predicted: {
    question: "What is the predicted error?",
    answer: [
      "What the model scores with these gains, after the flights so far have corrected it. Before the first flight nothing has corrected it yet.",
    ],
  },
  interval: {
    question: "What is the interval?",
    answer: [
      "Of ten flights, nine should end inside it. It counts how much flights with the same gains scatter, and how well the model is known.",
      "A flight outside teaches more than one inside: the model is off, or something happened to the vehicle.",
    ],
  },
  bias: {
    question: "How is the model corrected by the flights?",
    answer: [
      "By a bias: what the best flight did beyond the model's flight with the same gains, sample by sample, is added to what the model says of other gains. So a simple model is right where it was flown, and good enough near by.",
      "The strategy “calibrated” first fits the vehicle's own parameters to the flights; what is left over is the bias.",
    ],
  },
  trustRegion: {
    question: "What is the trusted region?",
    answer: [
      "How far a step may go from the best gains flown. It grows when predictions hold, and shrinks when a flight disagrees or is aborted.",
    ],
  },
  fitted: {
    question: "What was learned of the vehicle?",
    answer: [
      "The model's parameters that fit the flights best, each ± its standard error, beside what was known before any flight. A value that moves over the days tells of wear.",
    ],
  },
  gradient: {
    question: "What is the gradient?",
    answer: [
      "By how much the predicted error changes with each gain, from flights of the corrected model with a little more and a little less of it. Steps go against it; the longest that promises most is flown.",
    ],
  },
  gate: {
    question: "How are gains checked?",
    answer: [
      "Exactly, where a product in the autopilot's 32-bit numbers could wrap; and in flights of the model over the spread of what is not known about the vehicle, aborted at any instant too.",
    ],
  },
  glitch: {
    question: "What is a glitch?",
    answer: [
      "A stretch that no flight can have had: too fast a change, the same value again and again, nothing at all. It is marked on the curve; the stored record is never altered.",
    ],
  },
  curves: {
    question: "What do the lines mean?",
    answer: [
      "Dotted: the set point. Dash-dotted: the reference trajectory, the climb that the autopilot's own filter asks for on the way there, and that its loop follows.",
      "Thick: the best flight. Dark: the latest. Dashed in its band: where nine of ten flights with the next gains should run.",
    ],
  },
  threshold: {
    question: "What has the next flight to beat?",
    answer: [
      "The threshold of the paper's stop rule: below the best error by the improvement that this campaign asks for (under Settings, Stop). A flight above it counts as no improvement, and two in a row end the campaign.",
      "The band is where another flight of the best gains would land by chance: what falls in there is no news.",
    ],
  },
  scatter: {
    question: "Where does the scatter come from?",
    answer: [
      "The standard deviation of the error from flight to flight with the same gains. Before anything is repeated it is what such flights are known for; every repeat counts from then on.",
    ],
  },
  standardError: {
    question: "What is the standard error?",
    answer: [
      "How far a mean of so many flights is likely to be off: the scatter of one flight divided by the square root of their number. Four flights know it twice as well as one.",
    ],
  },
  difference: {
    question: "When is a difference real?",
    answer: [
      "Two flights with the same gains differ too. Better or worse is said only when chance alone would hardly do it; the best of many is judged more strictly, because the luckiest of many looks good.",
    ],
  },
  record: {
    question: "What is counted here?",
    answer: [
      "How many flights ended inside the 90\u00a0% interval that was predicted for them, and how many changed the error in the direction that was predicted.",
    ],
  },
  drift: {
    question: "What is drift?",
    answer: [
      "The same gains flying worse or better as the day goes on: battery, wind, wear. The last flight of the first gains is held against their first one, so they have to be flown again to see it.",
    ],
  },
  overshoot: {
    question: "What is the overshoot?",
    answer: ["How far the flight rose above its set point at its highest; 0 if it stayed below."],
  },
  warmStart: {
    question: "What is a warm start?",
    answer: [
      "The first flight uses this campaign's best gains. From how it goes the program sees whether the two vehicles are alike: then it builds on what was learned here, with a shorter first step; else it starts afresh.",
    ],
  },
  safeGains: {
    question: "What are safe gains?",
    answer: [
      "What the vehicle is given when it is connected, after every flight and with every abort, and then read back. A person answers for those of a real vehicle.",
    ],
  },
  linkAge: {
    question: "What is the link age?",
    answer: [
      "How long ago anything was last heard from the vehicle. Above 2 s what you see is no longer what is so: numbers turn grey.",
    ],
  },
  thrust: {
    question: "What does saturated mean?",
    answer: [
      "The loop asks for all the thrust there is, or for none. As long as it does, gains cannot change what the vehicle does.",
    ],
  },
});

export type Topic = keyof typeof EXPLANATIONS;

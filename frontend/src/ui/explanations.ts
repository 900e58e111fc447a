/** Help texts for each number: a question, and its answer in one paragraph or several; docs/method.md has the details. */
export const EXPLANATIONS = {
  error: [
    "What is the error?",
    "How far the flight was from its target. Takeoff: the mean of |3 m − altitude| over the scored window, 32.6 s unless set otherwise. Altitude steps: the mean of |reference − altitude| after the steps. F-16: the integral of |reference − pitch|.",
    "Lower is better. A takeoff cannot reach zero: Paparazzi's reference scores 0.091 m over 32.6 s.",
  ],
  altitude: [
    "What is the altitude measured from?",
    "On the ground it is the vehicle's own altitude, whose zero may lie above or below the ground. In flight, the altitude of ArduCopter and PX4 is measured from the ground where the vehicle stood; under Paparazzi it keeps the autopilot's own zero.",
  ],
  errorSoFar: [
    "What is the error so far?",
    "The error of the samples received so far. A takeoff starts at the ground, so its value starts high and falls; altitude steps are scored from the first step on. At the end of the scored window it is the error of the flight.",
  ],
  predicted: [
    "What is the predicted error?",
    "The error that the model predicts for a flight with these gains, corrected by the flights so far. Before the first valid flight it is often too uncertain to be shown.",
  ],
  interval: [
    "What is the interval?",
    "Nine out of ten flights should fall inside it. It covers the flight-to-flight scatter and the uncertainty of the model.",
    "A flight outside it can mean that the model is inaccurate, or that the vehicle or the conditions have changed.",
  ],
  bias: [
    "How do the flights correct the model?",
    "By a bias correction: the difference between the best flight and the model with the same gains, sample by sample, is added to every prediction. The corrected model is exact at the gains of the best flight and accurate near them.",
    "The strategy “calibrated” first fits the vehicle's parameters to the flights; the remaining difference is the bias.",
  ],
  trustRegion: [
    "What is the trust region?",
    "The largest step from the best gains flown. It grows when a prediction holds, and shrinks when an error is above its interval or the gains have caused an abort.",
  ],
  fitted: [
    "What are the fitted parameters?",
    "The model parameters that fit the flights best, each ± its standard error, next to their values before any flight. A value that drifts over days indicates wear.",
  ],
  gradient: [
    "What is the gradient?",
    "The change of the predicted error per unit of each gain, computed by simulating the corrected model with slightly higher and lower values. Steps follow the negative gradient; the step with the lowest predicted error is flown.",
  ],
  gate: [
    "What does the gate check?",
    "Bounds and step size; with a model also integer overflow in the autopilot's 32-bit arithmetic, and altitude, divergence, oscillation and aborts in simulated flights that cover the uncertainty of the vehicle's parameters.",
  ],
  glitch: [
    "What is a glitch?",
    "A part of the record that is physically impossible: a jump, a frozen value or a gap. It is marked on the curve. The stored record is never changed.",
  ],
  curves: [
    "What do the lines mean?",
    "Dotted: the set point. Dash-dotted: the reference trajectory, which the autopilot's control loop follows; under PX4 it is the set point itself.",
    "Thick: the best flight. Dark: the latest flight. Dashed, with its band: the prediction for the next gains. Nine out of ten flights should stay inside the band.",
  ],
  threshold: [
    "What does the next flight have to beat?",
    "The best error less the improvement threshold of the stop rule “No improvement”. Two consecutive flights above it, repeats not counted, end the campaign.",
    "The band shows how far the error of another flight with the best gains could vary by chance. A result inside it is not a resolvable change.",
  ],
  scatter: [
    "What is the flight-to-flight scatter?",
    "The standard deviation of the error over flights with the same gains. Without repeats it is a prior estimate; every repeat refines it.",
  ],
  standardError: [
    "What is the standard error?",
    "The uncertainty of a mean: the flight-to-flight scatter divided by the square root of the number of flights. Four flights halve it.",
  ],
  difference: [
    "When is a difference significant?",
    "Flights with the same gains differ too; ± is the standard error of the difference. The verdict is better or worse only if chance is an unlikely explanation. The best of many flights is tested more strictly, because being the best is partly chance.",
  ],
  record: [
    "How good are the predictions?",
    "The number of flights whose error fell inside the predicted 90\u00a0% interval, and the number whose error changed in the predicted direction.",
  ],
  drift: [
    "What is drift?",
    "A change of the error with the same gains over time, for example from battery, wind or wear. It is fitted as a straight line through all flights of gains that were flown at least twice, from the first such flight to the last.",
  ],
  overshoot: ["What is the overshoot?", "The maximum height above the set point; 0 if the flight stayed below it."],
  riseTime: [
    "What is the rise time?",
    "The time that the altitude takes to rise from 10\u00a0% to 90\u00a0% of the set point. It shows how fast the vehicle climbs.",
  ],
  settlingTime: [
    "What is the settling time?",
    "The time from the command until the altitude stays within ±5\u00a0% of the set point: 0.15 m for a takeoff to 3 m. A flight outside the band at its end did not settle.",
  ],
  steadyStateError: [
    "What is the steady-state error?",
    "The mean deviation from the set point over the last 5 s of the window; positive above the set point.",
  ],
  warmStart: [
    "What is a warm start?",
    "The first flight uses this campaign's best gains. If it shows that the two vehicles are similar, the new campaign builds on the results of this one, with a shorter first step; otherwise it starts from scratch.",
  ],
  safeGains: [
    "What are safe gains?",
    "The gains that are written to the vehicle and read back after every flight, on every abort, and at every connection except the first, which only compares them. The operator is responsible for those of a real vehicle.",
  ],
  linkAge: [
    "What is the link age?",
    "Time since the last packet from the vehicle. Above 2 s the values are stale and turn grey.",
  ],
  throttle: [
    "What does saturated mean?",
    "The control loop demands maximum or zero throttle. While it is saturated, the gains have no effect.",
  ],
} satisfies Record<string, readonly [question: string, ...answer: string[]]>;

export type Topic = keyof typeof EXPLANATIONS;

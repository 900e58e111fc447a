import { Anchor, Button, Group, Stack, Text } from "@mantine/core";
import { IconDownload, IconRepeat } from "@tabler/icons-react";
import { Link } from "wouter";
import { useCreateTrial } from "../../../api/mutations";
import { recordCsv, useCampaign, useStatistics } from "../../../api/queries";
import type { Campaign, Trial } from "../../../api/types";
import { Aside } from "../../../ui/Aside";
import { StateBadge } from "../../../ui/Badges";
import { asSentence, flightsText, NOTHING, percentChange, percentText, withUnit } from "../../../ui/format";
import { GainList } from "../../../ui/gains";
import { HelpTip } from "../../../ui/HelpTip";
import { LabelledValue } from "../../../ui/LabelledValue";
import { Note } from "../../../ui/Note";
import { ErrorNotice } from "../../../ui/Notices";
import { Panel } from "../../../ui/Panel";
import { trialStateLabel } from "../../../ui/states";
import { hasStepResponse, MEASURES, measureText } from "../../../ui/stepResponse";
import { Time } from "../../../ui/Time";
import { confidenceText, intervalText, plusMinus } from "../../../ui/uncertainty";
import { useHasModel, useUnits } from "../../../ui/units";
import { FlightMarkers, PredictionResult } from "../flights/FlightMarkers";
import { FlightNotes, type NotePin } from "../flights/FlightNotes";
import { AbortCause, FlightReview } from "../flights/FlightReview";
import { standingWithout } from "../flights/review";
import { comparisonAddress } from "../flights/useSelectedFlights";
import { scrollUpOnceBegun } from "../next-flight/nextStep";
import { useSpeed } from "../next-flight/speed";
import { isPriorScatter } from "../statistics/scatter";
import { PromoteGains } from "./PromoteGains";
import classes from "./VerdictPanel.module.css";
import { bestBeforeOf, bestBeforeTitle, comparedWith, isScored, repeatPurpose, sentenceOf, VERDICTS } from "./verdict";

interface Props {
  trial: Trial;
  trials: readonly Trial[];
  /** On the flight's own page, which needs no link to itself; null until a time has been selected. */
  pin?: NotePin | null;
}

/** `error` against `other`; the same if their texts are equal. */
function Change({ error, other, unit }: { error: number | null; other: number | null | undefined; unit: string }) {
  const percent = percentChange(error, other);
  if (percent === null) return null;
  if (withUnit(error, unit) === withUnit(other, unit)) return <small>this flight is the same</small>;
  const lower = percent < 0;
  return (
    <Text component="small" c={lower ? "var(--best)" : "dimmed"} fz="fine">
      this flight is {percentText(Math.abs(percent))} {lower ? "lower" : "higher"}
    </Text>
  );
}

function unpredicted(hasModel: boolean, isFirst: boolean): string {
  if (!hasModel) return "None: Gainline has no model of this controller";
  return isFirst ? "None before the first valid flight" : NOTHING;
}

/** Result of a flight: compared with the best before it and with its prediction, and its review. */
export function VerdictPanel({ trial, trials, pin }: Props) {
  const bestBefore = bestBeforeOf(trial, trials);
  const statistics = useStatistics(trial.campaign_id).data;
  const campaign = useCampaign(trial.campaign_id).data;
  const isBest = trial.id === campaign?.best?.trial_id;
  const experiment = campaign?.definition.experiment ?? "takeoff";
  const unit = useUnits(experiment).error;
  const hasModel = useHasModel(experiment);
  const group = statistics?.groups.find(({ trial_numbers }) => trial_numbers.includes(trial.number));
  const bestWord = group === undefined || group.is_best ? "best" : "lowest error";
  const asked = repeatPurpose(trial);
  const without = standingWithout(trial, trials);
  const scatter = trial.state === "valid" ? statistics?.sigma : null;
  const isCompared = trial.comparisons.some(({ against }) => against === "best before");
  return (
    <Panel
      title={`Flight ${trial.number}${isBest && trial.state === "valid" ? ` · ${bestWord} so far` : ""}`}
      tools={
        <Group gap="0 14px" c="dimmed" fz="small">
          <Time at={trial.flown_at} />
          <FlightMarkers trial={trial} />
          <StateBadge words={trialStateLabel(trial.state)} />
        </Group>
      }
    >
      {asked && <Text fz="body">{asked}</Text>}
      {!isScored(trial) && <Text fz="body">{asSentence(sentenceOf(trial))}</Text>}
      {isScored(trial) && trial.reason && <Note fz="body">{asSentence(trial.reason)}</Note>}
      <AbortCause trial={trial} />
      <TrialComparisons trial={trial} best={bestBeforeTitle(trial, trials).toLowerCase()} unit={unit} />
      {trial.overrule_reason && (
        <Aside tone="warn" mt={6} fz="body">
          <strong>Refused by the gate, overruled:</strong> {trial.overrule_reason}
        </Aside>
      )}
      <dl className={classes["figures"]}>
        <LabelledValue
          title="Error"
          topic="error"
          value={
            <>
              {plusMinus(trial.error, scatter, unit)}{" "}
              {statistics && scatter ? (
                <small>
                  (± {isPriorScatter(statistics) ? "prior estimate of the scatter" : "flight-to-flight scatter"})
                </small>
              ) : null}
            </>
          }
        />
        <LabelledValue
          title="Predicted"
          topic="predicted"
          value={
            <>
              {trial.predicted_error === null
                ? unpredicted(hasModel, bestBefore === null)
                : withUnit(trial.predicted_error, unit)}{" "}
              {trial.predicted_interval && <small>{intervalText(trial.predicted_interval, unit)}</small>}{" "}
              <PredictionResult trial={trial} />
            </>
          }
        />
        {bestBefore && (
          <LabelledValue
            title={`${bestBeforeTitle(trial, trials)}, flight ${bestBefore.number}`}
            value={
              <>
                {withUnit(bestBefore.error, unit)}{" "}
                {!asked && !isCompared && !group?.trial_numbers.includes(bestBefore.number) && (
                  <Change error={trial.error} other={bestBefore.error} unit={unit} />
                )}
              </>
            }
          />
        )}
        {group !== undefined && group.errors.length > 1 && (
          <LabelledValue
            title={`Mean of ${flightsText(group.trial_numbers)}`}
            topic="standardError"
            value={
              <>
                {plusMinus(group.mean, group.standard_error, unit)}{" "}
                {group.standard_error !== null && <small>(± standard error)</small>}
              </>
            }
          />
        )}
        {hasStepResponse(trial) &&
          MEASURES.map((measure) => (
            <LabelledValue key={measure.name} {...measure} value={measureText(trial, measure)} />
          ))}
        <LabelledValue title="Gains" value={<GainList gains={trial.gains} experiment={experiment} />} />
      </dl>
      <Glitches trial={trial} unit={unit} />
      {without && (
        <Text fz="body" mb={4} role="status">
          {without}
        </Text>
      )}
      <Group gap="10px 14px" data-review>
        <FlightReview key={`${trial.id} ${trial.state}`} trial={trial} trials={trials} campaign={campaign} />
        {campaign && <RetryGains campaign={campaign} trial={trial} />}
        {trial.record !== null && (
          <Button
            component="a"
            href={recordCsv(trial.id)}
            download
            variant="default"
            leftSection={<IconDownload size={18} aria-hidden />}
          >
            Download record (CSV)
          </Button>
        )}
        <Anchor
          component={Link}
          to={comparisonAddress(trial.campaign_id, comparedWith(trial, trials, campaign?.best?.trial_id))}
          px={6}
          py={12}
          aria-label={`Compare flight ${trial.number}`}
        >
          Compare
        </Anchor>
        {pin === undefined && (
          <Anchor component={Link} to={`/campaigns/${trial.campaign_id}/flights/${trial.id}`} px={6} py={12}>
            Open flight
          </Anchor>
        )}
      </Group>
      <FlightNotes key={trial.id} trial={trial} pin={pin} />
      {campaign && isBest && campaign.state !== "finished" && <PromoteGains campaign={campaign} />}
    </Panel>
  );
}

/** Verdicts of the flight's gains against the best before it and against the first. */
function TrialComparisons({ trial, best, unit }: { trial: Trial; best: string; unit: string }) {
  if (trial.comparisons.length === 0) return null;
  const asked = repeatPurpose(trial) !== "";
  return (
    <Stack component="ul" gap={4} mt={8} fz="body" lh={1.4}>
      {trial.comparisons.map(({ against, trial_number, verdict, confidence, difference, standard_error }) => {
        const { word, Icon, color } = VERDICTS[verdict];
        return (
          <Group key={against} component="li" gap={8} wrap="nowrap" align="start">
            <Icon size={20} color={asked ? "var(--dim)" : color} aria-hidden />
            <span>
              {asked ? `These gains: ${verdict}` : <strong>{word}</strong>} vs. flight {trial_number} (
              {against === "first" ? "first" : best})
              {confidence !== null && `, ${confidenceText(confidence)} confidence`}:{" "}
              <span className="quantity">{plusMinus(Math.abs(difference), standard_error, unit)}</span>{" "}
              {difference < 0 ? "lower" : "higher"}{" "}
              <small>{standard_error === null ? "(no repeat flights yet)" : "(means, ± standard error)"}</small>
            </span>
          </Group>
        );
      })}
    </Stack>
  );
}

const KINDS = {
  acceleration: "Impossible acceleration",
  frozen: "Frozen samples",
  gap: "Gap",
  disagreement: "Sources disagree",
} as const;

/** Glitches of the record, and the error without them. The stored record is unchanged. */
function Glitches({ trial, unit }: { trial: Trial; unit: string }) {
  const { glitches } = trial;
  if (glitches.length === 0) return null;
  return (
    <Aside tone="bad" mb={14} fz="small">
      <h3>
        The record has {glitches.length === 1 ? "a glitch" : `${glitches.length} glitches`}
        <HelpTip topic="glitch" />
      </h3>
      <ul>
        {glitches.map(({ kind, start_s, end_s, sentence }) => (
          <li key={`${kind} ${start_s}`}>
            <strong>
              {KINDS[kind]}, {start_s.toFixed(2)} … {end_s.toFixed(2)} s.
            </strong>{" "}
            {sentence}
          </li>
        ))}
      </ul>
      {trial.repaired_error !== null && (
        <p>
          Error as recorded <span className="quantity">{plusMinus(trial.error, null, unit)}</span>, with the glitches
          interpolated <span className="quantity">{plusMinus(trial.repaired_error, null, unit)}</span>.
        </p>
      )}
    </Aside>
  );
}

/** Retry of the gains of an aborted or invalid flight: flown at once on a simulation, otherwise staged. */
function RetryGains({ campaign, trial }: { campaign: Campaign; trial: Trial }) {
  const create = useCreateTrial(campaign);
  const speed = useSpeed();
  const { can_fly, needs_staging } = campaign.vehicle;
  if (!campaign.actions.includes("plan") || !can_fly || !["aborted", "invalid"].includes(trial.state)) return null;
  const order = needs_staging ? {} : { fly: { speed } };
  return (
    <>
      <Button
        variant="default"
        leftSection={<IconRepeat size={18} aria-hidden />}
        loading={create.isPending}
        onClick={() => scrollUpOnceBegun(create.mutateAsync({ gains: trial.gains, ...order }))}
      >
        Fly these gains again
      </Button>
      <ErrorNotice error={create.error} />
    </>
  );
}

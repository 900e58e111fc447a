import { Anchor, Box, Button, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { Link } from "wouter";
import { useCreateCampaign } from "../../api/mutations";
import { useCatalogue } from "../../api/queries";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { Panel } from "../../ui/Panel";
import page from "../campaign/CampaignPage.module.css";
import { LogDrop, Progress } from "../log-analysis/ChooseLog";
import type { OngoingAnalysis } from "../log-analysis/useAnalysis";
import { firstPreset, openCampaign } from "../new-campaign/newCampaign";
import { ImportBundle } from "./ImportBundle";

const STEPS = [
  [
    "Fly",
    "The vehicle takes off with its default gains. The error is the mean distance from 3\u00a0m over 32.6\u00a0s.",
  ],
  ["Learn", "The flight is compared with a simple model, and the difference corrects the next prediction."],
  ["Step", "Gainline proposes the best of many gain sets on the model. You see why, and decide."],
] as const;

/** Empty list: two ways to begin, a campaign that is created with one click, or one log. */
export function FirstCampaign({ analysis }: { analysis: OngoingAnalysis }) {
  const catalogue = useCatalogue();
  const create = useCreateCampaign();
  const preset = catalogue.data && firstPreset(catalogue.data);
  return (
    <Stack component="section" gap={14} maw={1100} mx="auto" mt="2vh">
      <Stack align="center" gap={10} ta="center">
        <Drawing />
        <Title order={1} lh={1.15}>
          Tune a takeoff in a few flights
        </Title>
        <Note maw={560} fz="strong" lh={1.5}>
          Begin with a campaign, which flies one vehicle repeatedly, or with the log of one flight.
        </Note>
      </Stack>
      <Progress analysis={analysis} />
      <SimpleGrid minColWidth="min(320px, 100%)" autoFlow="auto-fit" spacing="var(--gap)">
        <Panel title="A campaign">
          <Stack component="ol" gap={8} mb={16}>
            {STEPS.map(([title, text], index) => (
              <Text key={title} component="li" lh={1.45}>
                <Text span inherit fw={650} c="var(--best)">
                  {index + 1}. {title}.
                </Text>{" "}
                {text}
              </Text>
            ))}
          </Stack>
          <Button
            size="lg"
            maw="100%"
            className={page["wrapping"]}
            loading={create.isPending}
            disabled={preset === undefined}
            leftSection={<IconPlus size={22} aria-hidden />}
            onClick={() => preset && create.mutate(preset.campaign, { onSuccess: openCampaign })}
          >
            Create “{preset?.title ?? "AR.Drone takeoff to 3 m, simulated"}”
          </Button>
          <Group gap="4px 18px" mt={8}>
            <Anchor component={Link} to="/new" display="inline-block" py={12}>
              Choose a preset or settings first
            </Anchor>
            <ImportBundle />
          </Group>
          <ErrorNotice error={catalogue.error ?? create.error} />
        </Panel>
        <LogDrop analysis={analysis} title="One log">
          <Text lh={1.45} mb={8}>
            Drop the log of a flight with climbs, descents and hover: ArduCopter's .bin, PX4's .ulg, a .tlog, or
            Paparazzi's .data.
          </Text>
          <Text lh={1.45}>
            You get the measured deviation, the fitted vehicle, and better gains as a parameter file. Kept as a flight
            of its vehicle, the log is compared with the next one.
          </Text>
        </LogDrop>
      </SimpleGrid>
    </Stack>
  );
}

/** Three takeoffs, each closer to the dotted set point. */
function Drawing() {
  return (
    <Box component="svg" w="min(420px, 90%)" viewBox="0 0 420 130" fill="none" strokeLinecap="round" aria-hidden>
      <path d="M10 48H410" stroke="var(--edge)" strokeWidth={1.5} strokeDasharray="2 6" />
      <path
        d="M10 120C46 120 56 12 96 12s64 46 122 34 60-34 102-22 52 20 90 22"
        stroke="var(--earlier)"
        strokeWidth={1.5}
      />
      <path d="M10 120C42 120 52 28 86 28s50 30 94 24 70-8 230-4" stroke="var(--earlier)" strokeWidth={2} />
      <path d="M10 120C40 120 46 44 78 44s36 6 78 4 120 0 254 0" stroke="var(--best)" strokeWidth={4} />
    </Box>
  );
}

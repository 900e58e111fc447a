import { ActionIcon, Anchor, Box, Button, Skeleton, Title } from "@mantine/core";
import { IconTrash } from "@tabler/icons-react";
import { type DragEvent, useState } from "react";
import { Link, useNavigate, useParams } from "react-router";
import { useCheckRecording, useChecks, useDeleteCheck } from "../../api/checks";
import { recordOf } from "../../api/records";
import { StateBadge } from "../../ui/Badges";
import { ErrorNotice } from "../../ui/Notices";
import classes from "../../ui/Page.module.css";
import { addPage } from "../../ui/paging";
import row from "../../ui/RowCard.module.css";
import { Time } from "../../ui/Time";
import { useTitle } from "../../ui/useTitle";
import { CheckForm, RefusedRecording } from "./CheckForm";
import { CheckResult } from "./CheckResult";
import { checkStateLabel, KINDS } from "./checks";

/** Comparison of a recorded controller with the replica in the model. */
export function ControllerPage() {
  useTitle("Controller check");
  const checkId = Number(useParams()["checkId"] ?? 0);
  const navigate = useNavigate();
  const upload = useCheckRecording();
  const [over, setOver] = useState(false);
  const check = (files: readonly File[], gains?: string) => {
    const recording = recordOf(files);
    if (recording === null) return;
    upload.mutate(
      { ...recording, ...(gains === undefined ? {} : { gains }) },
      { onSuccess: ({ id }) => void navigate(`/controller/${id}`) },
    );
  };
  const drop = (event: DragEvent) => {
    event.preventDefault();
    setOver(false);
    check([...event.dataTransfer.files]);
  };
  return (
    // biome-ignore lint/a11y/noStaticElementInteractions: dropping a file is a shortcut for the button below
    <div
      className={classes["stack"]}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={drop}
    >
      <Title order={1}>Controller check</Title>
      <RefusedRecording upload={upload} onCheck={check} />
      {checkId > 0 && <CheckResult key={checkId} checkId={checkId} upload={upload} onCheck={check} />}
      <CheckForm upload={upload} onCheck={check} over={over} brief={checkId > 0} />
      <EarlierChecks shown={checkId} />
    </div>
  );
}

/** Earlier checks, newest first. */
function EarlierChecks({ shown }: { shown: number }) {
  const checks = useChecks();
  const remove = useDeleteCheck();
  const navigate = useNavigate();
  const found = checks.data?.pages.flatMap((page) => page.items) ?? [];
  const total = checks.data?.pages[0]?.total ?? 0;
  return (
    <section>
      <ErrorNotice error={checks.error ?? remove.error} />
      {checks.isPending && <Skeleton height={90} radius="md" aria-busy="true" />}
      {found.length > 0 && (
        <Title order={2} c="dimmed" fz="body" mb={10}>
          Earlier checks
        </Title>
      )}
      <ul className={classes["list"]} aria-label="Earlier checks">
        {found.map(({ id, file_name, kind, passed, checked_at }) => (
          <li key={id} className={`${row["card"]} ${row["top"]}`}>
            <div className={`${row["what"]} ${row["spaced"]}`}>
              <Title order={3} fz="body">
                <Anchor
                  component={Link}
                  to={`/controller/${id}`}
                  className={row["link"]}
                  aria-current={id === shown || undefined}
                >
                  {file_name}
                </Anchor>
              </Title>
              <p className={`${row["facts"]} numbers`}>
                <StateBadge words={checkStateLabel(passed)} />
                <span>{KINDS[kind]}</span>
                <Time at={checked_at} />
              </p>
            </div>
            <ActionIcon
              color="gray"
              aria-label={`Delete the check of ${file_name}`}
              title="Delete"
              onClick={() =>
                remove.mutate(id, { onSuccess: () => id === shown && void navigate("/controller", { replace: true }) })
              }
            >
              <IconTrash size={20} color="var(--dim)" />
            </ActionIcon>
          </li>
        ))}
      </ul>
      {checks.hasNextPage && (
        <Box mt={20} ta="center">
          <Button variant="default" loading={checks.isFetchingNextPage} onClick={() => void addPage(checks)}>
            Show more ({found.length} of {total})
          </Button>
        </Box>
      )}
    </section>
  );
}
